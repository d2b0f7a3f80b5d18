"""The description of one unit: units/<UNIT>/unit.toml."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import Layout, Table, has_table, read_tables, read_toml, shown
from triaxcal.model.positions import AXES
from triaxcal.unit.certificate import CERTIFICATE_KEYS, CertificateDetails, certificate_details
from triaxcal.unit.measured import MEASURED_KEYS, Measured, measured_details
from triaxcal.unit.recording import (
    DEFAULT_LSB,
    KEYS,
    RecordingLayout,
    is_in_folder,
    recording_layout,
)

ESTIMATORS = ("equation-10", "least-squares", "half-sum")
OUTPUT_Q_RANGE = (8, 30)
THERMAL_MODELS = ("polynomial", "piecewise-linear")
METHODS = ("matrix", "inverse", "additive", "additive-simplified", "additive-first-order")

FORMAT = 1
UNIT_FILE = "unit.toml"
T0_TOLERANCE_DEGC = 2.0
"""A dwell this near to T0 counts as one at T0."""
STANDARD_GRAVITY_M_PER_S2 = 9.80665
PLAUSIBLE_DEGC = (-200.0, 400.0)
"""Temperatures outside these are mistakes: no electronic accelerometer works there."""

UNCERTAINTY_MAX = {
    "squareness_arcsec": 36000.0,
    "repeatability_arcsec": 36000.0,
    "level_arcsec": 36000.0,
    "gravity_m_per_s2": 0.1,
    "thermometer_degc": 10.0,
    "thermometer_drift_degc": 10.0,
}
"""Keys of [uncertainty], each a standard uncertainty, and the largest value of each."""

_LAYOUT: Layout = {
    "": {"format": True, "serial": True, "description": False},
    "adc": {"bits": True, "full_scale_v": True, "code_min": False, "code_max": False},
    "temperature_sensor": {"degc_per_code": True, "degc_at_zero": False},
    "site": {"local_gravity_m_per_s2": True},
    "thermal": {
        "t0_degc": True,
        "range_degc": False,
        "model": False,
        "order": False,
        "knots_degc": False,
    },
    "fit": {"estimator": False, "terms": False, "loss": False},
    "sensor": {"polarity": False},
    "compensation": {"method": False, "output_q": False, "model_error_max_micro_g": False},
    "limits": {"at_t0_g": False, "over_range_g": False},
    "uncertainty": dict.fromkeys(UNCERTAINTY_MAX, False),
    "certificate": dict.fromkeys(CERTIFICATE_KEYS, False),
    "recording": dict.fromkeys(KEYS, False),
    "measured": dict.fromkeys(MEASURED_KEYS, False),
    "quadratic": {"cross_coupling": False, "axes": False},
}
_OF_RECORDING: Layout = {
    **_LAYOUT,
    "adc": {**dict.fromkeys(_LAYOUT["adc"], False), "lsb": False},
    "temperature_sensor": dict.fromkeys(_LAYOUT["temperature_sensor"], False),
    "thermal": dict.fromkeys(_LAYOUT["thermal"], False),
}
"""Of a unit with [recording]: what a tilter's must say has a default there."""
TERMS = ("auto", "linear", "quadratic")
LOSSES = ("linear", "huber", "cauchy")
RECORDING_LIMIT_G = 0.02
"""Limit of P1 (13) by itself for a recording: P1's own are a navigation accelerometer's."""
RECORDING_DEGC_PER_CODE = 2.0**-7
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}", re.ASCII)
_NAME_RULE = "1 to 64 of A-Z a-z 0-9 - _, the first a letter or digit"


@dataclass(frozen=True)
class Adc:
    """How a raw code stands for a voltage: U = code * full_scale_v / 2^(bits - 1)."""

    bits: int
    full_scale_v: float
    code_min: int
    code_max: int

    @property
    def volts_per_code(self) -> float:
        """Volts of one code."""
        return float(self.full_scale_v / 2 ** (self.bits - 1))


@dataclass(frozen=True)
class TemperatureSensor:
    """How a temperature code stands for a temperature: T = code * degc_per_code + degc_at_zero."""

    degc_per_code: float
    degc_at_zero: float

    def degc(self, code: float) -> float:
        """Temperature of a code."""
        return code * self.degc_per_code + self.degc_at_zero

    def code(self, temp_degc: float) -> int:
        """Nearest code of a temperature."""
        return round((temp_degc - self.degc_at_zero) / self.degc_per_code)


@dataclass(frozen=True)
class ThermalChoice:
    """Which thermal functions to fit; `model` "auto" tries them all on held-out data.

    `order` belongs to "polynomial", `knots_degc` to "piecewise-linear"; None is the default.
    """

    model: str
    order: int | None
    knots_degc: tuple[float, ...] | None


def near_t0(temp_degc: float, t0_degc: float) -> bool:
    """Whether a dwell counts as one at T0."""
    return abs(temp_degc - t0_degc) <= T0_TOLERANCE_DEGC


@dataclass(frozen=True)
class Limits:
    """Largest | |a| - g | accepted after compensation, P1 (13), in g."""

    at_t0_g: float
    over_range_g: float

    def at(self, temp_degc: float, t0_degc: float) -> tuple[float, str]:
        """Limit at a temperature, g, and its key."""
        if near_t0(temp_degc, t0_degc):
            return self.at_t0_g, "limits.at_t0_g"
        return self.over_range_g, "limits.over_range_g"


@dataclass(frozen=True)
class StatedUncertainty:
    """Standard uncertainties that the user knows; None where the file does not say.

    Attributes
    ----------
    squareness_arcsec : of each test position about each axis, the same at all temperatures
    repeatability_arcsec : of each dwell about each axis
    level_arcsec : of the tilter as a whole against the unit's axes, about each axis
    gravity_m_per_s2 : of local gravity
    thermometer_degc : of the unit's thermometer, the same at calibration and in use
    thermometer_drift_degc : of its change between calibration and use
    """

    squareness_arcsec: float | None = None
    repeatability_arcsec: float | None = None
    level_arcsec: float | None = None
    gravity_m_per_s2: float | None = None
    thermometer_degc: float | None = None
    thermometer_drift_degc: float | None = None


@dataclass(frozen=True)
class PairSource:
    """File of a pair's readings on a dividing head, and the unit's axes that A and B are."""

    file: str
    axes: tuple[int, int]


@dataclass(frozen=True)
class UnitDescription:
    """One unit, validated.

    Attributes
    ----------
    name : str
        Name of the unit's folder.
    gravity_g : float
        Local gravity in g of 9.80665 m/s^2.
    range_degc : tuple of two floats, or None
        Working temperature range; None is the calibrated range.
    polarity : tuple of three signs, or None
        Signs of Kxx, Kyy, Kzz; None means that all three are alike.
    recording : RecordingLayout or None
        Where the readings are, when they are no measurements.csv of a tilter.
    terms, loss : str
        One of `TERMS`, `LOSSES`: of a recording's fit.
    adc_open : bool
        Whether a recording may widen [adc], which says nothing of its bits.
    pair : PairSource or None
        Readings of a pair whose cross-coupling is taken off.
    """

    name: str
    serial: str
    adc: Adc
    temperature_sensor: TemperatureSensor
    gravity_g: float
    t0_degc: float
    range_degc: tuple[float, float] | None
    polarity: tuple[int, int, int] | None
    estimator: str
    thermal: ThermalChoice
    method: str
    output_q: int
    model_error_max_micro_g: float
    limits: Limits
    stated: StatedUncertainty = StatedUncertainty()
    certificate: CertificateDetails | None = None
    recording: RecordingLayout | None = None
    terms: str = "auto"
    loss: str = "linear"
    adc_open: bool = False
    pair: PairSource | None = None
    measured: Measured = field(default_factory=Measured)


def read_unit(folder: Path) -> UnitDescription:
    """Description of the unit in `folder`, from its unit.toml.

    Raises
    ------
    RefusedError
        When there is no such unit, its file breaks a rule of docs/file-formats.md, or another
        unit beside it has the same serial number.
    """
    path = find_unit(folder)
    recorded = has_table(path, "recording")
    tables = read_tables(path, _OF_RECORDING if recorded else _LAYOUT, FORMAT)
    unit = _unit_from_tables(folder.absolute().name, tables)
    _refuse_duplicate_serial(folder, unit.serial)
    return unit


def check_unit_name(name: str, where: str = "unit name") -> None:
    """Refuse a name of a unit, or a serial number, that is unfit for folders and C comments.

    Raises
    ------
    RefusedError
        Unless it is 1 to 64 ASCII letters, digits, '-' and '_', the first a letter or digit.
    """
    if not _NAME.fullmatch(name):
        raise RefusedError(where, f"found {shown(name)}", expected=_NAME_RULE)


def list_units(units_dir: Path) -> list[str]:
    """Names of the units in a folder, sorted; none when there is no such folder."""
    try:
        names = sorted(entry.name for entry in units_dir.iterdir())
    except OSError:
        return []
    return [name for name in names if _NAME.fullmatch(name) and _is_unit(units_dir / name)]


def find_unit(folder: Path) -> Path:
    """Path of the unit.toml in a unit's folder.

    Raises
    ------
    RefusedError
        When the name is unfit, a '..' follows a named folder, or the folder has no unit.toml;
        names the units that there are.
    """
    if any(b == ".." and a != ".." for a, b in pairwise(folder.parts)):
        raise RefusedError(str(folder), "'..' in the name of a unit", expected=_NAME_RULE)
    check_unit_name(folder.absolute().name, f"unit {shown(str(folder))}")
    if _is_unit(folder):
        return folder / UNIT_FILE
    for units_dir in (folder, folder.parent, folder.parent.parent):
        if names := list_units(units_dir):
            more = f" and {len(names) - 20} more" if len(names) > 20 else ""
            remedy = f"units in {units_dir}: " + ", ".join(names[:20]) + more
            break
    else:
        remedy = "make it as docs/add-a-unit.md tells"
    found = f"no {UNIT_FILE} in it" if folder.is_dir() else "no such unit"
    raise RefusedError(str(folder), found, remedy=remedy)


def _is_unit(folder: Path) -> bool:
    try:
        return (folder / UNIT_FILE).is_file()
    except OSError:  # a folder that may not be entered
        return False


def _unit_from_tables(name: str, tables: dict[str, Table]) -> UnitDescription:
    top, thermal, site = tables[""], tables["thermal"], tables["site"]
    compensation, limits = tables["compensation"], tables["limits"]
    if "description" in top:
        top.text("description")  # for people; nothing is made of it
    check_unit_name(top.text("serial"), top.where("serial"))
    range_degc = (
        thermal.rising("range_degc", *PLAUSIBLE_DEGC, range(2, 3))
        if "range_degc" in thermal
        else None
    )
    gravity_m_per_s2 = site.number("local_gravity_m_per_s2", 9.7, 9.9)
    recording = recording_layout(tables["recording"])
    limits_g = (3e-4, 10e-4) if recording is None else (RECORDING_LIMIT_G, RECORDING_LIMIT_G)
    return UnitDescription(
        name=name,
        serial=top.text("serial"),
        adc=_adc(tables["adc"]) if recording is None else _adc_of(recording, tables["adc"]),
        temperature_sensor=_temperature_sensor(tables["temperature_sensor"]),
        gravity_g=gravity_m_per_s2 / STANDARD_GRAVITY_M_PER_S2,
        t0_degc=_number(thermal, "t0_degc", *PLAUSIBLE_DEGC, default=20.0),
        range_degc=(range_degc[0], range_degc[1]) if range_degc else None,
        polarity=_polarity(tables["sensor"]),
        estimator=_choice(tables["fit"], "estimator", ("auto", *ESTIMATORS)),
        thermal=_thermal_choice(thermal),
        method=_choice(compensation, "method", METHODS),
        output_q=compensation.integer("output_q", *OUTPUT_Q_RANGE)
        if "output_q" in compensation
        else 24,
        model_error_max_micro_g=_number(
            compensation, "model_error_max_micro_g", 1e-3, 1e6, default=1.0
        ),
        limits=Limits(
            at_t0_g=_number(limits, "at_t0_g", 1e-9, 1.0, default=limits_g[0]),
            over_range_g=_number(limits, "over_range_g", 1e-9, 1.0, default=limits_g[1]),
        ),
        stated=_stated(tables["uncertainty"]),
        certificate=certificate_details(tables["certificate"]),
        recording=recording,
        terms=_choice(tables["fit"], "terms", TERMS),
        loss=_choice(tables["fit"], "loss", LOSSES),
        adc_open=recording is not None and not tables["adc"].values,
        pair=_pair(tables["quadratic"]),
        measured=measured_details(tables["measured"]),
    )


def _pair(table: Table) -> PairSource | None:
    if not table.values:
        return None
    for key in ("cross_coupling", "axes"):
        if key not in table:
            raise RefusedError(
                table.where(key),
                "missing",
                expected='cross_coupling = "pair.csv" and axes = ["x", "y"], those of A and B',
            )
    name = table.text("cross_coupling")
    if not is_in_folder(name):
        raise table.refuse("cross_coupling", "a file in the unit's folder", "copy it there")
    axes = table.values["axes"]
    if (
        not isinstance(axes, list)
        or len(axes) != 2
        or not all(isinstance(a, str) and a in AXES for a in axes)
        or axes[0] == axes[1]
    ):
        raise table.refuse("axes", 'the axes that A and B are, as ["x", "y"]')
    return PairSource(name, (AXES.index(axes[0]), AXES.index(axes[1])))


def _choice(table: Table, key: str, choices: tuple[str, ...]) -> str:
    """One of `choices`, the first by default."""
    return table.choice(key, choices) if key in table else choices[0]


def _number(table: Table, key: str, low: float, high: float, *, default: float) -> float:
    return table.number(key, low, high) if key in table else default


def _adc(table: Table) -> Adc:
    bits = table.integer("bits", 8, 32)
    half = 2 ** (bits - 1)
    low = table.integer("code_min", -half, half - 1) if "code_min" in table else -half
    high = table.integer("code_max", -half, half - 1) if "code_max" in table else half - 1
    if low >= high:
        key = "code_min" if "code_min" in table else "code_max"
        raise table.refuse(key, f"code_min below code_max, which are {low} and {high}")
    return Adc(bits, table.number("full_scale_v", 1e-3, 100.0), low, high)


def _adc_of(recording: RecordingLayout, table: Table) -> Adc:
    """How a raw code stands for a reading of a recording: "V" is the reading's unit."""
    unit = recording.acceleration_unit
    if "full_scale_v" in table:
        if unit != "V" or "lsb" in table or "bits" not in table:
            raise RefusedError(
                table.where("full_scale_v"),
                f'given for a recording in "{unit}"',
                expected=f"lsb, the reading in {unit} of one raw code, and bits",
            )
        return _adc(table)
    lsb = _number(table, "lsb", 1e-12, 1e6, default=DEFAULT_LSB[unit])
    bits = table.integer("bits", 8, 32) if "bits" in table else _bits_of(unit)
    values = {"bits": bits, "full_scale_v": 1} | {
        key: table.values[key] for key in ("code_min", "code_max") if key in table
    }
    adc = _adc(Table(table.file, table.name, values))
    return Adc(bits, lsb * 2.0 ** (bits - 1), adc.code_min, adc.code_max)


def _bits_of(unit: str) -> int:
    return 16 if unit == "count" else 24


def _temperature_sensor(table: Table) -> TemperatureSensor:
    return TemperatureSensor(
        degc_per_code=_number(table, "degc_per_code", 1e-6, 10.0, default=RECORDING_DEGC_PER_CODE),
        degc_at_zero=_number(table, "degc_at_zero", -1e4, 1e4, default=0.0),
    )


def _thermal_choice(table: Table) -> ThermalChoice:
    model = _choice(table, "model", ("auto", *THERMAL_MODELS))
    for key, owner in (("order", "polynomial"), ("knots_degc", "piecewise-linear")):
        if key in table and model != owner:
            raise RefusedError(
                table.where(key),
                f'given with model = "{model}"',
                expected=f'it with model = "{owner}" only',
                remedy="remove it, or choose that model",
            )
    return ThermalChoice(
        model=model,
        order=table.integer("order", 0, 9) if "order" in table else None,
        knots_degc=(
            table.rising("knots_degc", *PLAUSIBLE_DEGC, range(1, 65))
            if "knots_degc" in table
            else None
        ),
    )


def _stated(table: Table) -> StatedUncertainty:
    found = {k: table.number(k, 0.0, high) for k, high in UNCERTAINTY_MAX.items() if k in table}
    return StatedUncertainty(**found)


def _polarity(table: Table) -> tuple[int, int, int] | None:
    if "polarity" not in table:
        return None
    signs = table.values["polarity"]
    legal = isinstance(signs, list) and all(type(s) is int and abs(s) == 1 for s in signs)
    if not isinstance(signs, list) or not legal or len(signs) != 3:
        raise table.refuse("polarity", "a list of three signs, each 1 or -1")
    return (signs[0], signs[1], signs[2])


def _refuse_duplicate_serial(folder: Path, serial: str) -> None:
    units_dir = folder.absolute().parent
    for name in list_units(units_dir):
        other = units_dir / name
        if not other.samefile(folder) and _serial_leniently(other / UNIT_FILE, serial) == serial:
            raise RefusedError(
                f"{folder / UNIT_FILE}, serial",
                f'"{serial}" is also the serial of {folder.parent / name}',
                expected="a serial number of its own for each unit",
                remedy="correct one of the two",
            )


def _serial_leniently(path: Path, serial: str) -> object:
    """Serial in another unit's file; None when unreadable, or when `serial` is nowhere in it.

    A broken neighbour must not block this unit, and a thousand neighbours must not cost a
    thousand parses.
    """
    try:
        if serial.encode() not in path.read_bytes():
            return None
        return read_toml(path).get("serial")
    except (OSError, RefusedError):
        return None
