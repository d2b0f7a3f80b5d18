"""A calibration -> the functions that the device evaluates, their integers, and the C of them."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from triaxcal.base.screentext import table
from triaxcal.codegen.angles import angles_plan
from triaxcal.codegen.constants import Provenance
from triaxcal.codegen.outputs.output import Job
from triaxcal.codegen.outputs.registry import output_files
from triaxcal.codegen.routines import Answers, Int32Array
from triaxcal.codegen.tryout import run_on_dwells
from triaxcal.delivery.fitted import Fitted
from triaxcal.delivery.judgement import verdict_on
from triaxcal.delivery.order import Functions, choose_functions
from triaxcal.delivery.verdict import Verdict
from triaxcal.fitting.converter import input_words, plain_name
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.tilter.acceptance import dwells_in_range
from triaxcal.fixedpoint.angles import AnglesPlan
from triaxcal.fixedpoint.arithmetic import INT32_MAX
from triaxcal.fixedpoint.integer_model import apply, set_temperature
from triaxcal.fixedpoint.plan import Plan
from triaxcal.fixedpoint.proof import Bound
from triaxcal.fixedpoint.rate import RATE_Q
from triaxcal.model.methods.compensation import Compensation
from triaxcal.model.methods.method import DIRECT, INVERSE
from triaxcal.model.methods.registry import METHODS
from triaxcal.model.metrological import unpack_constants
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray
from triaxcal.readings.measurements import Dwell
from triaxcal.uncertainty.device_sources import Device
from triaxcal.uncertainty.evaluate import Uncertainty, uncertainty
from triaxcal.unit.choices import ESTIMATOR_WORDS
from triaxcal.unit.description import UnitDescription

_FORMS = {
    DIRECT: "gain N(T) and offset as functions of temperature",
    INVERSE: "K(T) and U0(T) as fitted, inverted on the device",
}
"""What the device evaluates."""
_WIDTH = 92
"""Columns of a line in the header's comment."""


@dataclass(frozen=True)
class Firmware:
    """What the device evaluates, and the files that it takes.

    Attributes
    ----------
    fitted : Fitted
    functions : Functions
        Of temperature, and what they miss.
    """

    fitted: Fitted
    functions: Functions

    @property
    def compensation(self) -> Compensation:
        """Functions of temperature, in floats."""
        return self.functions.compensation

    @property
    def plan(self) -> Plan:
        """The same in integers."""
        return self.functions.plan

    @property
    def model_error_g(self) -> float:
        """Largest error of the compensation against K(T)^-1 (U - U0(T)), for any codes, in g."""
        return self.functions.model_error_g

    @property
    def bound(self) -> Bound:
        """Proven error of the arithmetic."""
        return self.functions.bound

    @property
    def error_g(self) -> float:
        """Largest error against K(T)^-1 (U - U0(T)): that of arithmetic and method."""
        return self.functions.error_g

    @property
    def angles(self) -> AnglesPlan | None:
        """The angles that the device makes; None for none."""
        choice = self.fitted.unit.angles
        return None if choice is None else angles_plan(choice, self.plan)

    @cached_property
    def uncertainty(self) -> Uncertainty:
        """Uncertainty of the unit, the device's own errors included."""
        fitted = self.fitted
        device = Device(self.plan.shape.output_q, self.bound.per_axis_lsb, self.model_error_g)
        return uncertainty(fitted.unit, fitted.measurements, fitted.calibration, device)

    @cached_property
    def verdict(self) -> Verdict:
        """Verdict on the unit with this firmware: what its header and all reports say."""
        return verdict_on(self.fitted, self._errors_g(), self.uncertainty)

    @cached_property
    def files(self) -> dict[str, bytes]:
        """Name and content."""
        return _files(self)

    @property
    def provenance(self) -> Provenance:
        """Where the constants come from, without the summary of their header."""
        unit = self.fitted.unit
        date = unit.measured.date
        return Provenance(
            unit.serial,
            self.fitted.inputs_sha256,
            (),
            "" if date is None else date.isoformat(),
            ", ".join(map(plain_name, self.fitted.calibration.inputs)),
        )

    def _errors_g(self) -> FloatArray:
        """| |a| - g | at the dwells in the range by the integers, in which the C equals, (n,)."""
        unit, calibration = self.fitted.unit, self.fitted.calibration
        dwells = dwells_in_range(unit, calibration.range_degc, self.fitted.measurements)
        rates = rate_codes(unit, dwells).astype(np.int64)

        def routine(temp: Int32Array, raw: Int32Array) -> Answers:
            state, flags = set_temperature(self.plan, temp.astype(np.int64), rates)
            accel, more = apply(self.plan, state, raw.astype(np.int64))
            return accel.astype(np.int32), (flags | more).astype(np.uint32)

        source = self.fitted.measurements.source
        tried = run_on_dwells(unit, calibration.thermal, source, dwells, {unit.method: routine})
        return np.abs([r.error_g for r in tried[-1].residuals])


def rate_codes(unit: UnitDescription, dwells: Sequence[Dwell]) -> Int32Array:
    """dT/dt of the dwells in codes of the firmware, shape (n,)."""
    code = unit.temperature_sensor.degc_per_code * 2.0**-RATE_Q
    rates = np.rint([d.rate_k_per_s / code for d in dwells])
    return rates.clip(-INT32_MAX, INT32_MAX).astype(np.int32)


def make_firmware(fitted: Fitted) -> Firmware:
    """Firmware of a calibration, by the method and formats of its unit.

    Raises
    ------
    RefusedError
        When no integers of the format hold the functions, they miss the fitted model by more than
        [compensation] model_error_max_micro_g, or a binary decision rule refuses the unit.
    """
    unit = fitted.unit
    made = Firmware(fitted, choose_functions(unit, fitted.measurements, fitted.calibration))
    if unit.limits.rule.binary and made.verdict.refusal is not None:
        raise made.verdict.refusal
    return made


def _files(firmware: Firmware) -> dict[str, bytes]:
    fitted, plan = firmware.fitted, firmware.plan
    unit, calibration = fitted.unit, fitted.calibration
    low, high = calibration.range_degc
    reading = calibration.reading_unit
    method = METHODS[firmware.compensation.method].label
    more = f", with {calibration.terms.words}" if calibration.terms.words else ""
    summary = (
        f"method {method}: {_FORMS[plan.shape.form]}, {low:g} to {high:g} degC",
        f"functions of order {plan.shape.order} on {plan.shape.segments} segment(s)",
        f"thermal model: {calibration.shape.label}{more}, fitted to {fitted_to(calibration)}",
        f"raw code: {unit.adc.bits} bits for {unit.adc.full_scale_v:g} {reading} full scale",
        "code32 is a raw code left-justified to 32 bits",
        *_reading_note(unit, calibration),
        *_constants_at_t0(calibration),
        *_tested(firmware.verdict),
    )
    provenance = replace(firmware.provenance, summary=summary)
    return output_files(Job(plan, unit.temperature_sensor, provenance, firmware.angles))


def fitted_to(calibration: Calibration) -> str:
    """What the constants were fitted to, and how."""
    if calibration.recording is None:
        return f"six positions, bias by {ESTIMATOR_WORDS[calibration.estimator]}"
    return f"{len(calibration.recording.poses.poses)} poses, {calibration.recording.route}"


def _reading_note(unit: UnitDescription, calibration: Calibration) -> tuple[str, ...]:
    """What a raw code is where the readings are a recording's: its column, and no volts."""
    reading = calibration.reading_unit
    columns = input_words(calibration.inputs, "raw_code")
    if reading == "V":
        return tuple(columns)
    code = f"{unit.adc.volts_per_code:.9g} {reading}"
    return (*columns, f"raw code = reading / {code}")


def _constants_at_t0(calibration: Calibration) -> list[str]:
    t0_degc = calibration.thermal.t0_degc
    K, U0 = unpack_constants(calibration.thermal.constants_at(t0_degc))
    units = f"K x, y, z in {calibration.gain_unit} and U0 in {calibration.reading_unit}"
    return (
        [f"at {t0_degc:g} degC, {units}:"]
        + [
            f"  {axis}  {K[i, 0]:+.9f} {K[i, 1]:+.9f} {K[i, 2]:+.9f}   {U0[i]:+.9f}"
            for i, axis in enumerate(AXES)
        ]
        + calibration.terms.lines()
    )


def _tested(verdict: Verdict) -> list[str]:
    """The verdict, and what was held against each limit."""
    words = textwrap.wrap(f"verdict: {verdict.words}", _WIDTH, subsequent_indent="  ")
    return [*words, *(f"  {line}" for line in table(verdict.heads, verdict.rows))]
