"""A calibration -> the functions that the device evaluates, their integers, and the C of them."""

from __future__ import annotations

from dataclasses import dataclass

from triaxcal.base.errors import RefusedError
from triaxcal.codegen.constants import Provenance
from triaxcal.codegen.outputs.output import Job
from triaxcal.codegen.outputs.registry import output_files
from triaxcal.codegen.tryout import model_error_g
from triaxcal.delivery.fitted import Fitted
from triaxcal.fitting.converter import input_words
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fixedpoint.plan import Plan, make_plan
from triaxcal.model.methods.compensation import Compensation, compensate
from triaxcal.model.methods.registry import METHODS
from triaxcal.model.metrological import unpack_constants
from triaxcal.model.positions import AXES
from triaxcal.unit.description import UnitDescription


@dataclass(frozen=True)
class Firmware:
    """What the device evaluates, and the files that it takes.

    Attributes
    ----------
    compensation : Compensation
        Functions of temperature, in floats.
    plan : Plan
        The same in integers.
    model_error_g : float
        Largest error of the compensation against K(T)^-1 (U - U0(T)) at any temperature code and
        any raw code, in g.
    files : dict
        Name and content.
    """

    compensation: Compensation
    plan: Plan
    model_error_g: float
    files: dict[str, bytes]


def make_firmware(fitted: Fitted) -> Firmware:
    """Firmware of a calibration, by the method and formats of its unit.

    Raises
    ------
    RefusedError
        When no integers of the format hold the functions, or they miss the fitted model by more
        than [compensation] model_error_max_micro_g.
    """
    unit, calibration = fitted.unit, fitted.calibration
    compensation = compensation_of(unit, calibration, unit.method)
    plan = make_plan(compensation, unit)
    error_g = model_error_g(unit, calibration.thermal, plan)
    _refuse_model_error(unit, plan, error_g)
    return Firmware(compensation, plan, error_g, _files(fitted, compensation, plan))


def compensation_of(unit: UnitDescription, calibration: Calibration, method: str) -> Compensation:
    """The functions that the device evaluates for one method."""
    return compensate(
        calibration.thermal,
        method,
        calibration.range_degc,
        unit.adc.largest_v,
        unit.model_error_max_micro_g * 1e-6,
        terms=calibration.terms,
    )


def _files(fitted: Fitted, compensation: Compensation, plan: Plan) -> dict[str, bytes]:
    unit, calibration = fitted.unit, fitted.calibration
    low, high = calibration.range_degc
    reading = calibration.reading_unit
    method = METHODS[compensation.method].label
    summary = (
        f"method {method}: {plan.shape.form} form, {low:g} to {high:g} degC",
        f"functions of order {plan.shape.order} on {plan.shape.segments} segment(s)",
        f"thermal model: {calibration.shape.label}, bias estimator {calibration.estimator}",
        f"raw code: {unit.adc.bits} bits for {unit.adc.full_scale_v:g} {reading} full scale",
        "code32 is a raw code left-justified to 32 bits",
        *_reading_note(unit, calibration),
    )
    provenance = Provenance(
        unit.serial, fitted.inputs_sha256, (*summary, *_constants_at_t0(calibration))
    )
    return output_files(Job(plan, unit.temperature_sensor, provenance))


def _reading_note(unit: UnitDescription, calibration: Calibration) -> tuple[str, ...]:
    """What a raw code is where the readings are a recording's: its column, and no volts."""
    reading = calibration.reading_unit
    columns = input_words(calibration.inputs, "raw_code")
    if reading == "V":
        return tuple(columns)
    code = f"{unit.adc.volts_per_code:.9g} {reading}"
    return (*columns, f"raw code = reading / {code}; V below stands for {reading}")


def _constants_at_t0(calibration: Calibration) -> list[str]:
    t0_degc = calibration.thermal.t0_degc
    K, U0 = unpack_constants(calibration.thermal.constants_at(t0_degc))
    units = f"K x, y, z in {calibration.gain_unit} and U0 in {calibration.reading_unit}"
    return [f"at {t0_degc:g} degC, {units}:"] + [
        f"  {axis}  {K[i, 0]:+.9f} {K[i, 1]:+.9f} {K[i, 2]:+.9f}   {U0[i]:+.9f}"
        for i, axis in enumerate(AXES)
    ]


def _refuse_model_error(unit: UnitDescription, plan: Plan, error_g: float) -> None:
    """The order of N(T) is chosen on a grid; what counts is every temperature code."""
    limit_g = unit.model_error_max_micro_g * 1e-6
    if METHODS[unit.method].keeps_error and error_g > limit_g:
        raise RefusedError(
            f"{unit.source}, [compensation] model_error_max_micro_g",
            f"N(T) of order {plan.shape.order} is {error_g * 1e6:.4g} micro-g off the fitted model",
            expected=f"at most {limit_g * 1e6:g} micro-g",
            remedy='choose method = "inverse", or allow more',
        )
