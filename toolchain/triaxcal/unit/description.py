"""The description of one unit: units/<UNIT>/unit.toml."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import FORMAT as FORMAT_KEY
from triaxcal.base.keys import FileKeys, Key, TableKeys, Values, keys_of, setting
from triaxcal.base.kinds import (
    TEXT,
    Kind,
    checked,
    interval,
    number,
    pattern,
    three,
    whole,
    word,
)
from triaxcal.base.tomltable import read_toml, shown, toml_document
from triaxcal.model.methods.registry import METHODS
from triaxcal.model.positions import AXES
from triaxcal.model.thermal.registry import AUTO, THERMAL_FUNCTIONS, owners, thermal_keys
from triaxcal.model.thermal.shape import PLAUSIBLE_DEGC, Settings
from triaxcal.unit.certificate import CERTIFICATE, CertificateDetails, certificate_details
from triaxcal.unit.measured import MEASURED, Measured
from triaxcal.unit.recording import DEFAULT_LSB, RECORDING, RecordingLayout, recording_layout
from triaxcal.unit.recordingfile import FILE

ESTIMATORS = ("equation-10", "least-squares", "half-sum")
OUTPUT_Q_RANGE = (8, 30)

FORMAT = 1
UNIT_FILE = "unit.toml"
T0_TOLERANCE_DEGC = 2.0
"""A dwell this near to T0 counts as one at T0."""
STANDARD_GRAVITY_M_PER_S2 = 9.80665

TERMS = ("auto", "linear", "quadratic")
LOSSES = ("linear", "huber", "cauchy")
RECORDING_LIMIT_G = 0.02
"""Limit of P1 (13) by itself for a recording: P1's own are a navigation accelerometer's."""
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}", re.ASCII)
_NAME_RULE = "1 to 64 of A-Z a-z 0-9 - _, the first a letter or digit"

SERIAL = Key(
    "serial",
    pattern(_NAME.pattern, f"text in quotes, {_NAME_RULE}", '"SN-0001"'),
    "Serial number; no two units in one folder may share it.",
)
DESCRIPTION = Key("description", TEXT, "For people; nothing is made of it.", "")
TOP = TableKeys("", "The unit.", (FORMAT_KEY, SERIAL, DESCRIPTION))
GRAVITY = Key(
    "local_gravity_m_per_s2",
    number(9.7, 9.9),
    "Gravity at the place of the measurements; g is this / 9.80665.",
    unit="m/s^2",
    example="9.8111",
)
LATITUDE = Key(
    "latitude_deg",
    number(-90.0, 90.0),
    "Of the place, north positive.",
    unit="deg",
    example="50.45",
)


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


_CODE = whole(-(2**31), 2**31 - 1)
BITS = Key("bits", whole(8, 32), "Width of the signed raw code.", unit="bit", example="24")
FULL_SCALE = Key(
    "full_scale_v",
    number(1e-3, 100.0),
    "Voltage of the code 2^(bits - 1): U = code * full_scale_v / 2^(bits - 1).",
    unit="V",
    example="2.5",
)
CODE_MIN = Key(
    "code_min",
    _CODE,
    "Lowest raw code that the firmware treats as good.",
    None,
    "code",
    "-2^(bits - 1)",
)
CODE_MAX = Key("code_max", _CODE, "Highest good raw code.", None, "code", "2^(bits - 1) - 1")
LSB = Key(
    "lsb",
    number(1e-12, 1e6),
    "Reading of one raw code, in the unit of the recording; in place of full_scale_v.",
    None,
    default_words="1 count; 2^-16 m/s^2, 2^-20 g, 2^-10 mg, 2^-22 V, 2^-12 mV",
    example="1",
)
ADC = TableKeys("adc", "What the raw codes are.", (BITS, FULL_SCALE, CODE_MIN, CODE_MAX))


@dataclass(frozen=True)
class TemperatureSensor:
    """How a temperature code stands for a temperature: T = code * degc_per_code + degc_at_zero.

    Attributes
    ----------
    degc_per_code
        T = code * degc_per_code + degc_at_zero; at most 131 072 codes in the working range,
        each of which is proved and tested.
    degc_at_zero
        Temperature of the code 0.
    """

    degc_per_code: float = setting(number(1e-6, 10.0), unit="degC", example="0.0078125")
    degc_at_zero: float = setting(number(-1e4, 1e4), 0.0, "degC")

    def degc(self, code: float) -> float:
        """Temperature of a code."""
        return code * self.degc_per_code + self.degc_at_zero

    def code(self, temp_degc: float) -> int:
        """Nearest code of a temperature."""
        return round((temp_degc - self.degc_at_zero) / self.degc_per_code)


TEMPERATURE_SENSOR = TableKeys(
    "temperature_sensor", "What the codes of the thermometer are.", keys_of(TemperatureSensor)
)
SITE = TableKeys("site", "Where the unit is measured.", (GRAVITY,))


@dataclass(frozen=True)
class ThermalChoice:
    """Which thermal functions to fit; `model` "auto" tries them all on held-out data.

    `settings` are the values of the function's own keys.
    """

    model: str
    settings: Settings = field(default_factory=dict)


T0 = Key(
    "t0_degc", number(*PLAUSIBLE_DEGC), "T0, the reference temperature.", unit="degC", example="20"
)
RANGE_DEGC = Key(
    "range_degc",
    interval(*PLAUSIBLE_DEGC),
    "Working temperature range; outside it the firmware clamps and flags.",
    None,
    "degC",
    "the fitted dwells' range, outward in steps of 0.1, at most 0.5 beyond the outer temperatures",
    example="[-40, 85]",
)


def _thermal() -> TableKeys:
    return TableKeys("thermal", "Temperature.", (T0, RANGE_DEGC, *thermal_keys()))


def near_t0(temp_degc: float, t0_degc: float) -> bool:
    """Whether a dwell counts as one at T0."""
    return abs(temp_degc - t0_degc) <= T0_TOLERANCE_DEGC


@dataclass(frozen=True)
class Limits:
    """Largest | |a| - g | accepted after compensation, P1 (13), in g.

    Attributes
    ----------
    at_t0_g
        Largest | |a| - g | that is accepted at T0, P1 (13).
    over_range_g
        The same over the working range.
    """

    at_t0_g: float = setting(number(1e-9, 1.0), 3e-4, "g")
    over_range_g: float = setting(number(1e-9, 1.0), 10e-4, "g")

    def at(self, temp_degc: float, t0_degc: float) -> tuple[float, str]:
        """Limit at a temperature, g, and its key."""
        if near_t0(temp_degc, t0_degc):
            return self.at_t0_g, "limits.at_t0_g"
        return self.over_range_g, "limits.over_range_g"


@dataclass(frozen=True)
class StatedUncertainty:
    """[uncertainty]: standard uncertainties that the user knows; None where none is stated.

    Attributes
    ----------
    squareness_arcsec
        Of each test position's tilt about each axis, the same at all temperatures.
    repeatability_arcsec
        Of the tilt of each single dwell about each axis.
    level_arcsec
        Of the tilter as a whole against the unit's axes, about each axis.
    gravity_m_per_s2
        Of local gravity.
    thermometer_degc
        Of the unit's thermometer, the same at calibration and in use.
    thermometer_drift_degc
        Of the thermometer's change between calibration and use.
    """

    squareness_arcsec: float | None = setting(
        number(0.0, 36000.0), None, "arcsec", words="from the residuals"
    )
    repeatability_arcsec: float | None = setting(
        number(0.0, 36000.0), None, "arcsec", words="from the residuals"
    )
    level_arcsec: float | None = setting(number(0.0, 36000.0), None, "arcsec", words="20, assumed")
    gravity_m_per_s2: float | None = setting(number(0.0, 0.1), None, "m/s^2", words="5e-5, assumed")
    thermometer_degc: float | None = setting(number(0.0, 10.0), None, "degC", words="0.1, assumed")
    thermometer_drift_degc: float | None = setting(
        number(0.0, 10.0), None, "degC", words="0.02, assumed"
    )


def _axis_pair(value: object) -> tuple[int, int]:
    names = value if isinstance(value, list) else []
    a, b = (AXES.index(name) for name in names)
    if a == b:
        raise ValueError
    return a, b


@dataclass(frozen=True)
class PairSource:
    """[quadratic]: readings of a pair on a dividing head, and the unit's axes that A and B are.

    Attributes
    ----------
    axes
        The unit's axes that A and B are.
    """

    file: str
    axes: tuple[int, int] = setting(
        Kind(
            'the axes that A and B are, as ["x", "y"]',
            _axis_pair,
            {"type": "array", "items": {"enum": list(AXES)}, "minItems": 2, "maxItems": 2},
            example='["x", "y"]',
        )
    )


CROSS_COUPLING = Key(
    "cross_coupling",
    FILE,
    "A pair's readings on a dividing head, in the unit's folder; its cross-coupling is removed.",
    example='"pair.csv"',
)


LIMITS = TableKeys("limits", "What is accepted.", keys_of(Limits))


@dataclass(frozen=True)
class _Fit:
    """[fit].

    Attributes
    ----------
    estimator
        How K and U0 come from six positions: P1 (10); least squares; (10) with the bias from an
        axis' own two positions.
    terms
        Of a recording: which candidates are tried.
    loss
        Of a recording: how far a pose that stands out may pull.
    """

    estimator: str = setting(word(("auto", *ESTIMATORS)), "auto")
    terms: str = setting(word(TERMS), "auto")
    loss: str = setting(word(LOSSES), "linear")


@dataclass(frozen=True)
class _Compensation:
    """[compensation].

    Attributes
    ----------
    method
        What the firmware evaluates.
    output_q
        The LSB of the result is 2^-output_q g.
    model_error_max_micro_g
        How far the firmware's functions may be from the fitted model.
    """

    method: str = setting(TEXT, METHODS.names[0])
    output_q: int = setting(whole(*OUTPUT_Q_RANGE), 24)
    model_error_max_micro_g: float = setting(number(1e-3, 1e6), 1.0, "micro-g")


POLARITY = Key(
    "polarity",
    three(
        checked(lambda v: type(v) is int and abs(v) == 1, "a sign", {"enum": [1, -1]}, "1"),
        "a list of three signs, each 1 or -1",
    ),
    "Signs of Kxx, Kyy, Kzz, where they differ.",
    None,
    default_words="all alike",
)


def _common() -> tuple[TableKeys, ...]:
    return (
        TableKeys("fit", "How the constants are fitted.", keys_of(_Fit)),
        TableKeys("sensor", "The sensor itself.", (POLARITY,)),
        TableKeys("compensation", "What the firmware computes.", keys_of(_Compensation)).but(
            method={"kind": word(METHODS.names), "doc": METHODS.explained}
        ),
        TableKeys(
            "uncertainty",
            "Standard uncertainties that you know.",
            keys_of(StatedUncertainty),
        ),
        CERTIFICATE,
        MEASURED,
        TableKeys(
            "quadratic",
            "Cross-coupling that a dividing head has shown.",
            (CROSS_COUPLING, *keys_of(PairSource)),
            optional=True,
        ),
    )


def tilter_file() -> FileKeys:
    """Keys of the unit.toml of a unit on a tilter."""
    return FileKeys(
        UNIT_FILE,
        "A unit on a tilter",
        (TOP, ADC, TEMPERATURE_SENSOR, SITE, _thermal(), LIMITS, *_common()),
    )


def recording_file() -> FileKeys:
    """Keys of the unit.toml of a unit with a recording."""
    limit = {"default": RECORDING_LIMIT_G}
    return FileKeys(
        UNIT_FILE,
        "A unit with a recording",
        (
            TOP,
            RECORDING,
            SITE,
            ADC.relaxed().but(LSB, bits={"default_words": "16 of counts, else 24"}),
            TEMPERATURE_SENSOR.but(degc_per_code={"default": 2.0**-7}),
            _thermal().but(t0_degc={"default": 20.0}),
            LIMITS.but(at_t0_g=limit, over_range_g=limit),
            *_common(),
        ),
        ("acceleration", "acceleration_unit", "time"),
    )


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
        When there is no such unit, its file breaks a rule of docs/reference/keys.md, or another
        unit beside it has the same serial number.
    """
    path = find_unit(folder)
    unit = _unit_of_document(folder.absolute().name, read_toml(path), str(path))
    _refuse_duplicate_serial(folder, unit.serial)
    return unit


def unit_of_text(name: str, text: str, source: str) -> UnitDescription:
    """Description of a unit from the text of a unit.toml; `source` is for messages.

    Raises
    ------
    RefusedError
        When the name is unfit, or the text breaks a rule of unit.toml.
    """
    check_unit_name(name, f"unit {shown(name)}")
    return _unit_of_document(name, toml_document(source, text.encode()), source)


def _unit_of_document(name: str, document: Mapping[str, object], source: str) -> UnitDescription:
    file = recording_file() if "recording" in document else tilter_file()
    return _unit_of(name, file.check(source, document))


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
        remedy = f"`triaxcal init {folder}` writes a first unit.toml"
    found = f"no {UNIT_FILE} in it" if folder.is_dir() else "no such unit"
    raise RefusedError(str(folder), found, remedy=remedy)


def _is_unit(folder: Path) -> bool:
    try:
        return (folder / UNIT_FILE).is_file()
    except OSError:  # a folder that may not be entered
        return False


def _unit_of(name: str, tables: Mapping[str, Values]) -> UnitDescription:
    thermal, fit = tables["thermal"], tables["fit"].record(_Fit)
    compensation = tables["compensation"].record(_Compensation)
    recording = recording_layout(tables["recording"]) if "recording" in tables else None
    _ = tables[""][DESCRIPTION]  # for people; checked all the same
    return UnitDescription(
        name=name,
        serial=tables[""][SERIAL],
        adc=_adc(tables["adc"]) if recording is None else _adc_of(recording, tables["adc"]),
        temperature_sensor=tables["temperature_sensor"].record(TemperatureSensor),
        gravity_g=tables["site"][GRAVITY] / STANDARD_GRAVITY_M_PER_S2,
        t0_degc=thermal[T0],
        range_degc=thermal[RANGE_DEGC],
        polarity=tables["sensor"][POLARITY],
        estimator=fit.estimator,
        thermal=_thermal_choice(thermal),
        method=compensation.method,
        output_q=compensation.output_q,
        model_error_max_micro_g=compensation.model_error_max_micro_g,
        limits=tables["limits"].record(Limits),
        stated=tables["uncertainty"].record(StatedUncertainty),
        certificate=certificate_details(tables["certificate"]),
        recording=recording,
        terms=fit.terms,
        loss=fit.loss,
        adc_open=recording is not None and not tables["adc"],
        pair=_pair(tables["quadratic"]),
        measured=tables["measured"].record(Measured),
    )


def _pair(values: Values) -> PairSource | None:
    return values.record(PairSource, file=values[CROSS_COUPLING]) if values else None


def _adc(values: Values, bits: int | None = None, full_scale_v: float | None = None) -> Adc:
    bits = bits or values[BITS]
    half = 2 ** (bits - 1)
    low, high = _code(values, CODE_MIN, half, -half), _code(values, CODE_MAX, half, half - 1)
    if low >= high:
        end = CODE_MIN if CODE_MIN in values else CODE_MAX
        raise values.refuse(end, f"code_min below code_max, which are {low} and {high}")
    return Adc(bits, values[FULL_SCALE] if full_scale_v is None else full_scale_v, low, high)


def _code(values: Values, end: Key[int | None], half: int, default: int) -> int:
    """An end of the good codes, which has to be one of the ADC."""
    found = replace(values, keys={})[replace(end, kind=whole(-half, half - 1))]
    return default if found is None else found


def _adc_of(recording: RecordingLayout, values: Values) -> Adc:
    """How a raw code stands for a reading of a recording: "V" is the reading's unit."""
    unit = recording.acceleration_unit
    if FULL_SCALE in values:
        if unit != "V" or LSB in values or BITS not in values:
            raise RefusedError(
                values.where(FULL_SCALE),
                f'given for a recording in "{unit}"',
                expected=f"lsb, the reading in {unit} of one raw code, and bits",
            )
        return _adc(values)
    lsb = values.optional(LSB) or DEFAULT_LSB[unit]
    bits = values.optional(BITS) or (16 if unit == "count" else 24)
    return _adc(values, bits, lsb * 2.0 ** (bits - 1))


def _thermal_choice(values: Values) -> ThermalChoice:
    model, *settings = thermal_keys()
    name = values[model]
    keys = () if name == AUTO else THERMAL_FUNCTIONS[name].keys
    for other in settings:
        if other in values and other.name not in {own.name for own in keys}:
            models = " or ".join(f'"{f.name}"' for f in owners(other.name))
            raise RefusedError(
                values.where(other),
                f'given with model = "{name}"',
                expected=f"it with model = {models} only",
                remedy="remove it, or choose that model",
            )
    return ThermalChoice(name, {own.name: values[own] for own in keys})


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
