"""What the simulated unit truly is, and the plan of its measurement: units/<UNIT>/truth.toml."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import FORMAT, FileKeys, Key, TableKeys, Values, keys_of, setting
from triaxcal.base.kinds import Kind, listed, number, rising, whole
from triaxcal.base.tomltable import shown
from triaxcal.model.curves import PiecewisePolynomial, ThermalModel
from triaxcal.model.metrological import CONSTANT_NAMES, voltage_from_force
from triaxcal.model.thermal.shape import PLAUSIBLE_DEGC
from triaxcal.model.types import FloatArray, IntArray
from triaxcal.unit.adc import Adc

TRUTH_FILE = "truth.toml"
SEED_MAX = 2**63 - 1
SEED: Kind[int] = replace(whole(0, SEED_MAX), expected="a whole number from 0 to 2^63 - 1")


@dataclass(frozen=True)
class Imperfections:
    """[imperfections]: standard deviations of what is wrong with the rig.

    Attributes
    ----------
    squareness_sd_arcsec
        Tilt of each test position about each axis, one draw a seed for all temperatures.
    repeatability_sd_arcsec
        Tilt of each dwell about each axis.
    level_sd_arcsec
        Rotation of the whole rig against the unit, about each axis, one draw a seed.
    gravity_sd_m_per_s2
        True gravity against local_gravity_m_per_s2 in unit.toml, one draw a seed.
    thermometer_offset_sd_degc
        What the thermometer shows too much, one draw a seed.
    """

    squareness_sd_arcsec: float = setting(number(0.0, 36000.0), 0.0, "arcsec")
    repeatability_sd_arcsec: float = setting(number(0.0, 36000.0), 0.0, "arcsec")
    level_sd_arcsec: float = setting(number(0.0, 36000.0), 0.0, "arcsec")
    gravity_sd_m_per_s2: float = setting(number(0.0, 0.1), 0.0, "m/s^2")
    thermometer_offset_sd_degc: float = setting(number(0.0, 10.0), 0.0, "degC")


@dataclass(frozen=True)
class Spread:
    """[series]: how the units of a series differ; standard deviations.

    Attributes
    ----------
    scale_sd_ratio
        Of Kxx, Kyy, Kzz, relative.
    cross_axis_sd_v_per_g
        Of the other entries of K.
    bias_sd_v
        Of U0.
    temperature_sd_ratio
        Of each coefficient of dT, dT^2, dT^3, relative.
    units_per_run
        Units measured on one day.
    runs_between_moves
        Days after which the rig is another: its tilts and its gravity are drawn anew.
    """

    scale_sd_ratio: float = setting(number(0.0, 0.1), example="0.01")
    cross_axis_sd_v_per_g: float = setting(number(0.0, 1.0), unit="V/g", example="0.001")
    bias_sd_v: float = setting(number(0.0, 1.0), unit="V", example="0.001")
    temperature_sd_ratio: float = setting(number(0.0, 1.0), example="0.1")
    units_per_run: int = setting(whole(1, 9999), example="8")
    runs_between_moves: int = setting(whole(1, 9999), example="5")


@dataclass(frozen=True)
class Truth:
    """Exact properties of a simulated unit.

    Attributes
    ----------
    constants : ThermalModel
        Cubic curves of the twelve constants.
    reading_sd_v, thermometer_sd_degc, dwell_temp_sd_degc : float
        [noise] of truth.toml.
    imperfections : Imperfections
        Of the rig; none by default.
    reading_sd_v
        Noise of one reading of an axis.
    thermometer_sd_degc
        Noise of one reading of the thermometer.
    dwell_temp_sd_degc
        Spread of the dwells' true temperatures about the nominal ones.
    """

    constants: ThermalModel
    reading_sd_v: float = setting(number(0.0, 1.0), unit="V", example="1e-5")
    thermometer_sd_degc: float = setting(number(0.0, 10.0), unit="degC", example="0.01")
    dwell_temp_sd_degc: float = setting(number(0.0, 10.0), unit="degC", example="0.05")
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
    """[plan]: what is measured, each test position and check position at its temperatures.

    Attributes
    ----------
    seed
        Seed of all noise; `--seed` replaces it.
    readings_per_dwell
        Readings in each mean.
    temperatures_degc
        Nominal temperatures of TP1 to TP6.
    check_temperatures_degc
        Nominal temperatures of CP1 to CP6.
    rig_seed
        Seed of the rig; units with the same one are measured on the same rig.
    """

    seed: int = setting(SEED, example="1")
    # Two readings at least: a standard deviation of one has no meaning.
    readings_per_dwell: int = setting(whole(2, 10**6), example="1000")
    temperatures_degc: tuple[float, ...] = setting(
        rising(*PLAUSIBLE_DEGC, 0, 64), unit="degC", example="[-40, -10, 20, 50, 85]"
    )
    check_temperatures_degc: tuple[float, ...] = setting(
        rising(*PLAUSIBLE_DEGC, 0, 64), unit="degC", example="[20]"
    )
    rig_seed: int | None = setting(SEED, None, words="a rig of its own", example="1")


T0 = Key("t0_degc", number(*PLAUSIBLE_DEGC), "Where dT = 0.", unit="degC", example="20")
_CUBIC = listed(number(), range(4, 5), "a list of 4 numbers")
CURVES = tuple(
    Key(
        name,
        _CUBIC,
        "Bias c0 + c1 dT + c2 dT^2 + c3 dT^3."
        if name.startswith("U0")
        else "Output of the first axis for 1 g along the second: c0 + c1 dT + c2 dT^2 + c3 dT^3.",
        unit="V, per degC^n" if name.startswith("U0") else "V/g, per degC^n",
        example="[0.5, 0, 0, 0]" if name in ("Kxx", "Kyy", "Kzz") else "[0, 0, 0, 0]",
    )
    for name in CONSTANT_NAMES
)
TRUTH = FileKeys(
    TRUTH_FILE,
    "What a simulated unit exactly is",
    (
        TableKeys("", "", (FORMAT,)),
        TableKeys("curves", "The constants over temperature.", (T0, *CURVES)),
        TableKeys("noise", "Noise of the readings.", keys_of(Truth)),
        TableKeys.of(Plan),
        TableKeys.of(Imperfections),
        TableKeys.of(Spread, optional=True),
    ),
)


def codes_of_voltage(adc: Adc, voltage_v: FloatArray) -> IntArray:
    """Codes of voltages, same shape: to the nearest (ties to even), saturated at the ADC's ends."""
    codes = np.rint(voltage_v / adc.volts_per_code)
    return np.clip(codes, adc.code_min, adc.code_max).astype(np.int64)


def read_truth(folder: Path) -> tuple[Truth, Plan]:
    """Truth and plan in a unit's truth.toml.

    Raises
    ------
    RefusedError
        When the file cannot be read or breaks a rule of docs/reference/keys.md.
    """
    tables = TRUTH.read(folder / TRUTH_FILE)
    truth = tables["noise"].record(
        Truth,
        constants=_curves(tables["curves"]),
        imperfections=tables["imperfections"].record(Imperfections),
    )
    return truth, tables["plan"].record(Plan)


def read_spread(folder: Path) -> Spread:
    """Table [series] of a unit's truth.toml.

    Raises
    ------
    RefusedError
        When it is missing or incomplete, or a value is out of range.
    """
    values = TRUTH.read(folder / TRUTH_FILE)["series"]
    if not values:
        raise RefusedError(
            f"{folder / TRUTH_FILE}",
            "no table [series]",
            expected="how the units of a series differ",
            remedy="add it, as docs/reference/file-formats.md says",
        )
    return values.record(Spread)


def check_seed(seed: int, where: str) -> None:
    """Refuse a seed that truth.toml could not hold.

    Raises
    ------
    RefusedError
        Unless it is a whole number from 0 to 2^63 - 1.
    """
    if not 0 <= seed <= SEED_MAX:
        raise RefusedError(where, f"found {shown(seed)}", expected="a whole number, 0 to 2^63 - 1")


def _curves(values: Values) -> ThermalModel:
    curves = PiecewisePolynomial(
        breaks_degc=PLAUSIBLE_DEGC,
        origins_degc=(values[T0],),
        coefficients=np.array([[values[curve] for curve in CURVES]], dtype=np.float64),
    )
    return ThermalModel(t0_degc=values[T0], curves=curves)
