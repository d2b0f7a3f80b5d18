"""The description of one unit: units/<UNIT>/unit.toml.

Each table of it is a file of this room; `tilter_file` and `recording_file` put them together.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from triaxcal.base.keys import DESCRIPTION, FileKeys, TableKeys, Values, many_of
from triaxcal.base.tomltable import content_of, shown, text_of, toml_document
from triaxcal.unit.adc import ADC, RECORDED_ADC, Adc, adc_of, recorded_adc
from triaxcal.unit.angles import AngleKeys, AnglesChoice
from triaxcal.unit.arithmetic import PORTABLE
from triaxcal.unit.certificate import CERTIFICATE, CertificateDetails, certificate_details
from triaxcal.unit.choices import FIT, SENSOR, Compensation, Fit, Sensor, compensation_table
from triaxcal.unit.equipment import (
    EQUIPMENT,
    Equipment,
    days_of,
    equipment_of,
    refuse_other_day,
)
from triaxcal.unit.folder import (
    SERIAL,
    TOP,
    UNIT_FILE,
    check_unit_name,
    find_unit,
    refuse_duplicate_serial,
)
from triaxcal.unit.gravity import gravity_difference_m_per_s2, refuse_wrong_gravity
from triaxcal.unit.limits import LIMITS, RECORDED_LIMITS, Limits, limits_of
from triaxcal.unit.measured import MEASURED, Measured
from triaxcal.unit.pair import QUADRATIC, PairSource, pair_source
from triaxcal.unit.passport import ENGLISH, PASSPORT, PassportChoice
from triaxcal.unit.prefix import DEFAULT_PREFIX
from triaxcal.unit.priors import (
    AUTO,
    FIRMWARE,
    PRIORS,
    QUADRATIC_TERMS,
    FirmwareChoice,
    Priors,
)
from triaxcal.unit.recordedtest import TEST, StatedTest, stated_tests
from triaxcal.unit.recording import RECORDING, RecordingLayout, recording_layout
from triaxcal.unit.reporting import NONLINEARITY, REPORT, Nonlinearity, Reporting, nonlinearity
from triaxcal.unit.site import SITE, STANDARD_GRAVITY_M_PER_S2, PlacedSite
from triaxcal.unit.thermal import Temperatures, ThermalChoice, thermal_choice, thermal_table
from triaxcal.unit.thermometer import TEMPERATURE_SENSOR, TemperatureSensor
from triaxcal.unit.uncertainty import UNCERTAINTY, StatedUncertainty
from triaxcal.unit.vibration import VIBRATION, Vibration, stated_vibrations


def _common() -> tuple[TableKeys, ...]:
    compensation = compensation_table()
    more = UNCERTAINTY, CERTIFICATE, MEASURED, EQUIPMENT, PASSPORT, QUADRATIC
    tests = REPORT, TEST, NONLINEARITY, VIBRATION
    return FIT, PRIORS, SENSOR, compensation, FIRMWARE, *more, *tests


def tilter_file() -> FileKeys:
    """Keys of the unit.toml of a unit on a tilter."""
    tables = (TOP, ADC, TEMPERATURE_SENSOR, SITE, thermal_table(), LIMITS, *_common())
    return FileKeys(UNIT_FILE, "A unit on a tilter", tables)


def recording_file() -> FileKeys:
    """Keys of the unit.toml of a unit with a recording."""
    tables = (
        TOP,
        RECORDING,
        SITE,
        RECORDED_ADC,
        TEMPERATURE_SENSOR.but(degc_per_code={"default": 2.0**-7}),
        thermal_table().but(t0_degc={"default": 20.0}),
        RECORDED_LIMITS,
        *_common(),
    )
    first = ("acceleration", "acceleration_unit", "time")
    return FileKeys(UNIT_FILE, "A unit with a recording", tables, first)


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
        Signs of Kxx, Kyy, Kzz, those of `nominal_v_per_g` where it is stated; None means that all
        three are alike.
    nominal_v_per_g : tuple of three floats, or None
        Sensitivities of the data sheet; a tilter's are within `nominal_tolerance` of them.
    gravity_difference_m_per_s2 : float or None
        Stated less normal gravity, where the place is stated.
    recording : RecordingLayout or None
        Where the readings are, when they are no measurements.csv of a tilter.
    terms, loss : str
        One of `TERMS`, `LOSSES`: of a recording's fit.
    adc_open : bool
        Whether a recording may widen [adc], which says nothing of its bits.
    pair : PairSource or None
        Readings of a pair whose cross-coupling is taken off.
    priors : Priors
    firmware_terms : str
        One of `unit.priors.FIRMWARE_TERMS`.
    prefix : str
        What the names in the C begin with.
    angles : AnglesChoice or None
        Which angles the device makes.
    reporting : Reporting
    tests : tuple of StatedTest
        Recordings beside the calibration, for the test report.
    nonlinearity : Nonlinearity or None
        Terms of the output that another test has shown.
    vibrations : mapping
        Stated vibrations by name.
    languages : tuple of str
        Codes of the languages of the passport.
    arithmetic : str
        How the C forms its products, one of `ARITHMETICS`.
    source : str
        Path of its unit.toml, for messages.
    toml : str
        Text of unit.toml that this was read from.
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
    model_error_max_micro_g: float | None
    limits: Limits
    stated: StatedUncertainty = field(default_factory=StatedUncertainty)
    certificate: CertificateDetails | None = None
    recording: RecordingLayout | None = None
    terms: str = "auto"
    loss: str = "linear"
    adc_open: bool = False
    pair: PairSource | None = None
    priors: Priors = field(default_factory=Priors)
    firmware_terms: str = AUTO
    prefix: str = DEFAULT_PREFIX
    angles: AnglesChoice | None = None
    arithmetic: str = PORTABLE

    @property
    def model_error_max_g(self) -> float | None:
        """How far the firmware's functions may be from the fitted model, where it is stated."""
        stated = self.model_error_max_micro_g
        return None if stated is None else stated * 1e-6

    @property
    def reading_unit(self) -> str:
        """Unit of the readings: V, or that of the recording."""
        return "V" if self.recording is None else self.recording.acceleration_unit

    nominal_v_per_g: tuple[float, float, float] | None = None
    nominal_tolerance: float = 0.2
    gravity_difference_m_per_s2: float | None = None
    measured: Measured = field(default_factory=Measured)
    equipment: tuple[Equipment, ...] = ()
    reporting: Reporting = field(default_factory=Reporting)
    tests: tuple[StatedTest, ...] = ()
    nonlinearity: Nonlinearity | None = None
    vibrations: Mapping[str, Vibration] = field(default_factory=dict)
    languages: tuple[str, ...] = (ENGLISH,)
    toml: str = field(default="", repr=False, compare=False)
    source: str = field(default=UNIT_FILE, compare=False)


def read_unit(folder: Path) -> UnitDescription:
    """Description of the unit in `folder`, from its unit.toml.

    Raises
    ------
    RefusedError
        When there is no such unit, its file breaks a rule of docs/reference/keys.md, or another
        unit beside it has the same serial number.
    """
    path = find_unit(folder)
    unit = _unit_of_content(folder.absolute().name, content_of(path), str(path))
    refuse_duplicate_serial(folder, unit.serial)
    return unit


def unit_of_text(name: str, text: str, source: str) -> UnitDescription:
    """Description of a unit from the text of a unit.toml; `source` is for messages.

    Raises
    ------
    RefusedError
        When the name is unfit, or the text breaks a rule of unit.toml.
    """
    check_unit_name(name, f"unit {shown(name)}")
    return _unit_of_content(name, text.encode("utf-8", "surrogatepass"), source)


def _unit_of_content(name: str, content: bytes, source: str) -> UnitDescription:
    document = toml_document(source, content)
    file = recording_file() if "recording" in document else tilter_file()
    unit = _unit_of(name, file.check(source, document))
    return replace(unit, toml=text_of(content), source=source)


def _unit_of(name: str, tables: Mapping[str, Values]) -> UnitDescription:
    fit, compensation = tables["fit"].record(Fit), tables["compensation"].record(Compensation)
    temperatures = tables["thermal"].record(Temperatures)
    recording = recording_layout(tables["recording"]) if "recording" in tables else None
    _ = tables[""][DESCRIPTION]  # not used, but checked
    adc, site = tables["adc"], tables["site"].record(PlacedSite)
    refuse_wrong_gravity(site, tables["site"].file)
    firmware = tables["firmware"].record(FirmwareChoice)
    sensor = tables["sensor"].record(Sensor)
    _refuse_inapplicable(tables, sensor)
    details, measured = (
        certificate_details(tables["certificate"]),
        tables["measured"].record(Measured),
    )
    refuse_other_day(tables["measured"], measured, details)
    return UnitDescription(
        name=name,
        serial=tables[""][SERIAL],
        adc=adc_of(adc) if recording is None else recorded_adc(recording, adc),
        temperature_sensor=tables["temperature_sensor"].record(TemperatureSensor),
        gravity_g=site.local_gravity_m_per_s2 / STANDARD_GRAVITY_M_PER_S2,
        t0_degc=temperatures.t0_degc,
        range_degc=temperatures.range_degc,
        polarity=_polarity(sensor, tables["sensor"]),
        estimator=fit.estimator,
        thermal=thermal_choice(tables["thermal"]),
        method=compensation.method,
        output_q=compensation.output_q,
        model_error_max_micro_g=compensation.model_error_max_micro_g,
        limits=limits_of(tables["limits"]),
        stated=tables["uncertainty"].record(StatedUncertainty),
        certificate=details,
        recording=recording,
        terms=fit.terms,
        loss=fit.loss,
        adc_open=recording is not None and not adc,
        pair=pair_source(tables["quadratic"]),
        priors=tables["priors"].record(Priors),
        firmware_terms=firmware.terms,
        prefix=firmware.prefix,
        angles=tables["firmware"].record(AngleKeys).choice,
        arithmetic=firmware.arithmetic,
        nominal_v_per_g=sensor.nominal_v_per_g,
        nominal_tolerance=sensor.nominal_tolerance,
        gravity_difference_m_per_s2=gravity_difference_m_per_s2(site),
        measured=measured,
        equipment=equipment_of(many_of(tables, "equipment"), days_of(measured, details)),
        languages=tables["passport"].record(PassportChoice).languages,
        reporting=tables["report"].record(Reporting),
        tests=stated_tests(tables),
        nonlinearity=nonlinearity(tables["nonlinearity"]),
        vibrations=stated_vibrations(tables),
    )


def _refuse_inapplicable(tables: Mapping[str, Values], sensor: Sensor) -> None:
    """Refuse what this kind of unit does not use."""
    if "recording" in tables:
        if sensor.nominal_v_per_g is not None:
            raise tables["sensor"].refuse(
                "nominal_v_per_g",
                "no such key with [recording], whose acceleration_unit tells the sensitivity",
                "remove it; [priors] mean_scale is how far the mean sensitivity may be from it",
            )
    elif tables["firmware"].record(FirmwareChoice).terms == QUADRATIC_TERMS:
        raise tables["firmware"].refuse(
            "terms",
            '"auto", "linear" or "own-squares": six positions do not show the other products',
            'set "own-squares"; products of a [quadratic] pair are in the C as they are',
        )


def _polarity(sensor: Sensor, values: Values) -> tuple[int, int, int] | None:
    """Signs of the sensitivities, from `polarity` or else from the nominal ones.

    Raises
    ------
    RefusedError
        Where both are stated and differ.
    """
    if sensor.nominal_v_per_g is None:
        return sensor.polarity
    x, y, z = (1 if v > 0.0 else -1 for v in sensor.nominal_v_per_g)
    if sensor.polarity not in (None, (x, y, z)):
        raise values.refuse("polarity", f"the signs of nominal_v_per_g, [{x}, {y}, {z}]")
    return x, y, z
