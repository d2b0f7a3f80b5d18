"""What the simulated unit truly is, and the plan of its measurement: units/<UNIT>/truth.toml."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import Layout, Table, read_tables, shown
from triaxcal.model.metrological import CONSTANT_NAMES, voltage_from_force
from triaxcal.model.thermal import PiecewisePolynomial, ThermalModel
from triaxcal.model.types import FloatArray, IntArray
from triaxcal.unit.description import PLAUSIBLE_DEGC, Adc

FORMAT = 1
TRUTH_FILE = "truth.toml"
SEED_MAX = 2**63 - 1
IMPERFECTIONS = {
    "squareness_sd_arcsec": 36000.0,
    "repeatability_sd_arcsec": 36000.0,
    "level_sd_arcsec": 36000.0,
    "gravity_sd_m_per_s2": 0.1,
    "thermometer_offset_sd_degc": 10.0,
}
"""Keys of [imperfections] and the largest value of each."""

SERIES_KEYS = (
    "scale_sd_ratio",
    "cross_axis_sd_v_per_g",
    "bias_sd_v",
    "temperature_sd_ratio",
    "units_per_run",
    "runs_between_moves",
)
"""Keys of [series], which `simulation.series` reads."""

_LAYOUT: Layout = {
    "": {"format": True},
    "curves": {"t0_degc": True, **dict.fromkeys(CONSTANT_NAMES, True)},
    "noise": {"reading_sd_v": True, "thermometer_sd_degc": True, "dwell_temp_sd_degc": True},
    "plan": {
        "seed": True,
        "readings_per_dwell": True,
        "temperatures_degc": True,
        "check_temperatures_degc": True,
        "rig_seed": False,
    },
    "imperfections": dict.fromkeys(IMPERFECTIONS, False),
    "series": dict.fromkeys(SERIES_KEYS, False),
}


@dataclass(frozen=True)
class Imperfections:
    """Standard deviations of what is wrong with the rig; one draw a seed unless said otherwise.

    Attributes
    ----------
    squareness_sd_arcsec : float
        Tilt of each test position, about each axis; the same at all temperatures.
    repeatability_sd_arcsec : float
        Tilt of each dwell, about each axis.
    level_sd_arcsec : float
        Rotation of the whole rig against the unit's axes, about each axis.
    gravity_sd_m_per_s2 : float
        Gravity at the rig against the one in unit.toml.
    thermometer_offset_sd_degc : float
        What the thermometer shows too much, at all temperatures.
    """

    squareness_sd_arcsec: float = 0.0
    repeatability_sd_arcsec: float = 0.0
    level_sd_arcsec: float = 0.0
    gravity_sd_m_per_s2: float = 0.0
    thermometer_offset_sd_degc: float = 0.0


@dataclass(frozen=True)
class Truth:
    """Exact properties of a simulated unit.

    Attributes
    ----------
    constants : ThermalModel
        Cubic curves of the twelve constants.
    reading_sd_v : float
        Noise of one reading of each axis, V.
    thermometer_sd_degc : float
        Noise of one reading of the thermometer.
    dwell_temp_sd_degc : float
        Spread of the dwells' true temperatures about the nominal ones.
    imperfections : Imperfections
        Of the rig; none by default.
    """

    constants: ThermalModel
    reading_sd_v: float
    thermometer_sd_degc: float
    dwell_temp_sd_degc: float
    imperfections: Imperfections = Imperfections()

    def voltage_v(self, force_g: FloatArray, temp_degc: FloatArray | float) -> FloatArray:
        """Outputs without noise in V, P1 (9).

        Force (..., 3) in g, true temperature (...); the result is (..., 3), axis order x, y, z.
        """
        return voltage_from_force(self.constants.constants_at(temp_degc), force_g)

    def codes(self, adc: Adc, force_g: FloatArray, temp_degc: FloatArray | float) -> IntArray:
        """Codes without noise, shapes as in `voltage_v`; beyond its range the ADC saturates."""
        return codes_of_voltage(adc, self.voltage_v(force_g, temp_degc))


@dataclass(frozen=True)
class Plan:
    """What is measured: each test position at each temperature, each check position likewise.

    Attributes
    ----------
    seed : int
        Seed of the noise.
    readings_per_dwell : int
        Readings in each mean.
    temperatures_degc, check_temperatures_degc : tuple of float
        Nominal temperatures of TP1..TP6 and of CP1..CP6, rising.
    rig_seed : int or None
        Seed of the rig that units measured on it share; None draws a rig for this unit.
    """

    seed: int
    readings_per_dwell: int
    temperatures_degc: tuple[float, ...]
    check_temperatures_degc: tuple[float, ...]
    rig_seed: int | None = None


def codes_of_voltage(adc: Adc, voltage_v: FloatArray) -> IntArray:
    """Codes of voltages, same shape: to the nearest (ties to even), saturated at the ADC's ends."""
    codes = np.rint(voltage_v / adc.volts_per_code)
    return np.clip(codes, adc.code_min, adc.code_max).astype(np.int64)


def read_truth(folder: Path) -> tuple[Truth, Plan]:
    """Truth and plan in a unit's truth.toml.

    Raises
    ------
    RefusedError
        When the file cannot be read or breaks a rule of docs/file-formats.md.
    """
    tables = read_truth_tables(folder)
    noise, wrong = tables["noise"], tables["imperfections"]
    truth = Truth(
        constants=_curves(tables["curves"]),
        reading_sd_v=noise.number("reading_sd_v", 0.0, 1.0),
        thermometer_sd_degc=noise.number("thermometer_sd_degc", 0.0, 10.0),
        dwell_temp_sd_degc=noise.number("dwell_temp_sd_degc", 0.0, 10.0),
        imperfections=Imperfections(
            **{
                key: wrong.number(key, 0.0, high)
                for key, high in IMPERFECTIONS.items()
                if key in wrong
            }
        ),
    )
    return truth, _plan(tables["plan"])


def read_truth_tables(folder: Path) -> dict[str, Table]:
    """Tables of a unit's truth.toml, keys checked.

    Raises
    ------
    RefusedError
        When the file cannot be read, or has other keys than docs/file-formats.md says.
    """
    return read_tables(folder / TRUTH_FILE, _LAYOUT, FORMAT)


def check_seed(seed: int, where: str) -> None:
    """Refuse a seed that truth.toml could not hold.

    Raises
    ------
    RefusedError
        Unless it is a whole number from 0 to 2^63 - 1.
    """
    if not 0 <= seed <= SEED_MAX:
        raise RefusedError(where, f"found {shown(seed)}", expected="a whole number, 0 to 2^63 - 1")


def _curves(table: Table) -> ThermalModel:
    t0_degc = table.number("t0_degc", *PLAUSIBLE_DEGC)
    rows = [[float(c) for c in table.decimals(name, 4)] for name in CONSTANT_NAMES]
    curves = PiecewisePolynomial(
        breaks_degc=PLAUSIBLE_DEGC,
        origins_degc=(t0_degc,),
        coefficients=np.array([rows], dtype=np.float64),
    )
    return ThermalModel(kind="polynomial", t0_degc=t0_degc, curves=curves)


def _plan(table: Table) -> Plan:
    lengths = range(65)
    return Plan(
        seed=table.integer("seed", 0, SEED_MAX),
        # Two readings at least: a standard deviation of one has no meaning.
        readings_per_dwell=table.integer("readings_per_dwell", 2, 1_000_000),
        temperatures_degc=table.rising("temperatures_degc", *PLAUSIBLE_DEGC, lengths),
        check_temperatures_degc=table.rising("check_temperatures_degc", *PLAUSIBLE_DEGC, lengths),
        rig_seed=table.integer("rig_seed", 0, SEED_MAX) if "rig_seed" in table else None,
    )
