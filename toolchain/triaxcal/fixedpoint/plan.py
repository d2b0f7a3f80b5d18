"""The plan: formats, shifts and coefficients that turn the float model into integers.

What the routine computes, for the raw codes u shifted left to fill int32 and x the temperature
normalised to Q31 on its segment (docs/explanation/fixed-point.md has the derivation):

    p_k = c_k + floor(x p_(k+1) / 2^32)      Horner from p_order = c_order down to p_0
    a_i = (sum_j n_ij u_j + b_i 2^32) >> output_shift       LSB 2^-output_q g

In the direct form n and b are the twelve p_0; in the inverse form those are K and U0, which the
device inverts. Each Horner step halves, so c_k carries one bit more than c_(k-1).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fixedpoint.arithmetic import round_half_up
from triaxcal.fixedpoint.device_units import device_polynomials, temperature_codes
from triaxcal.fixedpoint.formats import choose_inverse, choose_matrix_bits, choose_spare_bits
from triaxcal.fixedpoint.horner import Segment, horner, segment_of
from triaxcal.fixedpoint.quadratic import quadratic_log2, quantise_quadratic
from triaxcal.fixedpoint.rate import RatePlan, largest_offset_g, plan_rate
from triaxcal.fixedpoint.shape import FLOORS_LOSS, Shape
from triaxcal.model.methods.compensation import Compensation
from triaxcal.model.methods.method import INVERSE
from triaxcal.model.types import FloatArray, IntArray
from triaxcal.unit.adc import Adc
from triaxcal.unit.arithmetic import PORTABLE
from triaxcal.unit.prefix import DEFAULT_PREFIX
from triaxcal.unit.thermometer import TemperatureSensor

MAX_SEGMENTS = 64
"""Of the reference C; a piecewise-linear model with more knots follows noise."""

MAX_RAW_SHIFT = 30
"""The C multiplies by 2^raw_shift in int32."""


@dataclass(frozen=True)
class Plan:
    """Integers of one unit.

    Attributes
    ----------
    shape : Shape
        What the code is specialised to.
    temp_min_code, temp_max_code : int
        Working range; codes outside are clamped and flagged.
    segments : tuple of Segment
        Rising in temperature; functions in image order (`ROWS`).
    real : array, shape (segments, 12, order + 1)
        The real-valued polynomials in x that the integers stand for, in units of each function's
        own last place, without the bits that Horner's halving adds: the reference of the proof.
    volts_per_lsb : float
        Volts of one left-justified raw code.
    quadratic : array, shape (3, 6), or None
        Words of the quadratic terms, in the order of `PRODUCT_NAMES`.
    real_quadratic : array, shape (3, 6), or None
        What they stand for, in units of their last place.
    sensitivity : array, shape (3, 3), or None
        Words of a gyro's g-sensitivity, step G.
    real_sensitivity : array, shape (3, 3), or None
        What they stand for, in units of their last place.
    force_q : int
        Of a gyro: LSB of the specific force that it takes is 2^-force_q g.
    rate : RatePlan or None
        The term in dT/dt.
    prefix : str
        What the names in its C begin with.
    arithmetic : str
        One of `ARITHMETICS`: which form of the routine is delivered beside the portable one.
    reading : str
        Unit of the readings, which the names of variables call volts.
    """

    shape: Shape
    temp_min_code: int
    temp_max_code: int
    segments: tuple[Segment, ...]
    real: FloatArray
    volts_per_lsb: float
    quadratic: IntArray | None = None
    real_quadratic: FloatArray | None = None
    sensitivity: IntArray | None = None
    real_sensitivity: FloatArray | None = None
    force_q: int = 0
    rate: RatePlan | None = None
    prefix: str = DEFAULT_PREFIX
    arithmetic: str = PORTABLE
    reading: str = "V"

    @property
    def temp_codes(self) -> IntArray:
        """Every temperature code of the working range."""
        return np.arange(self.temp_min_code, self.temp_max_code + 1, dtype=np.int64)

    def real_rows(self) -> FloatArray:
        """What the state's integers stand for at every code, shape (codes, 3, 4), in their units.

        Evaluated in floats, to see how near samples come to the proven bound.
        """
        codes = self.temp_codes
        index = segment_of(self.segments, codes)
        origin = np.array([s.origin_code for s in self.segments])[index]
        gain = np.array([s.gain for s in self.segments])[index]
        x = ((codes - origin) * gain / 2.0**31)[:, None]
        value = self.real[index, :, -1]
        for k in range(self.real.shape[2] - 2, -1, -1):
            value = self.real[index, :, k] + x * value
        rows = value.reshape(-1, 3, 4)
        if self.shape.inverse is None:
            return rows
        N = np.linalg.inv(rows[:, :, :3]) * 2.0 ** (self.shape.inverse.scale_log2)
        offset = -np.einsum("nij,nj->ni", N, rows[:, :, 3]) / 2.0**32
        return np.concatenate([N, offset[:, :, None]], axis=2)


class Triad(Protocol):
    """What the plan needs to know of a triad; a `UnitDescription` has it."""

    @property
    def name(self) -> str:
        """Name of the unit."""

    @property
    def adc(self) -> Adc:
        """Converter of the three outputs."""

    @property
    def temperature_sensor(self) -> TemperatureSensor:
        """Thermometer."""

    @property
    def output_q(self) -> int:
        """Result's LSB is 2^-output_q."""

    @property
    def arithmetic(self) -> str:
        """Which form of the routine is asked for."""

    @property
    def prefix(self) -> str:
        """What the names in the C of the unit begin with."""


def make_plan(compensation: Compensation, unit: Triad) -> Plan:
    """Turn a compensation into integers that provably cannot overflow.

    Raises
    ------
    RefusedError
        When no format holds: names the input range or the coefficient to blame.
    """
    return triad_plan(compensation, unit, gyro=False)


def triad_plan(compensation: Compensation, unit: Triad, *, gyro: bool) -> Plan:
    """The plan of either triad, without a gyro's g-sensitivity: `make_plan`, `make_gyro_plan`."""
    where = f"unit {unit.name}"
    low, high = temperature_codes(compensation, unit.temperature_sensor, where)
    bits = max(unit.adc.code_max.bit_length(), (-unit.adc.code_min - 1).bit_length())
    raw_shift = min(31 - bits, MAX_RAW_SHIFT)
    if len(compensation.curves.origins_degc) > MAX_SEGMENTS:
        raise RefusedError(
            where,
            f"{len(compensation.curves.origins_degc)} segments",
            expected=f"at most {MAX_SEGMENTS}",
            remedy="choose fewer knots in thermal.knots_degc",
        )
    volts_per_lsb = unit.adc.volts_per_code / 2.0**raw_shift
    real, frames = device_polynomials(
        compensation, unit.temperature_sensor, unit.output_q, (low, high), volts_per_lsb
    )
    shape = Shape(
        form=compensation.form,
        segments=len(frames),
        order=compensation.curves.order,
        output_q=unit.output_q,
        output_shift=32,
        raw_min=unit.adc.code_min,
        raw_max=unit.adc.code_max,
        raw_shift=raw_shift,
        inverse=None,
        quadratic=compensation.terms.quadratic_per_g is not None,
        rate=compensation.terms.rate is not None,
        gyro=gyro,
    )
    plan = Plan(
        shape,
        low,
        high,
        tuple(frames),
        real,
        volts_per_lsb,
        prefix=unit.prefix,
        arithmetic=unit.arithmetic,
    )
    terms = compensation.terms
    room = np.zeros(3)
    if terms.rate is not None:
        # The loader allows for 2^31, which is up to twice what a rate times its gain reaches.
        room = largest_offset_g(terms.rate) * 2.0 ** (unit.output_q + 1)
    planned = _inverse_plan if compensation.form == INVERSE else _direct_plan
    plan = _with_quadratic(planned(plan, room, where), terms.quadratic_per_g, where)
    if terms.rate is None:
        return plan
    fraction = plan.shape.output_q + plan.shape.output_shift - 32
    rate = plan_rate(terms.rate, fraction, unit.temperature_sensor.degc_per_code, where)
    return replace(plan, rate=rate)


def _direct_plan(plan: Plan, room: FloatArray, where: str) -> Plan:
    spare = choose_spare_bits(plan.real, room, plan.shape, where)
    shape = replace(plan.shape, output_shift=32 + spare)
    real = plan.real * 2.0**spare
    preload = np.zeros(12)
    preload[3::4] = shape.rounding_in_offset
    return replace(plan, shape=shape, real=real, segments=_quantise(plan.segments, real, preload))


def with_high_words(plan: Plan) -> Plan | None:
    """The same functions with sums of high words; None where the shape has none.

    The offset holds what their floors lose more than the one of a 64-bit sum.
    """
    shape = plan.shape
    if shape.saturates or shape.adds_to_sums or shape.inverse is not None:
        return None
    segments = []
    for segment in plan.segments:
        coefficients = segment.coefficients.copy()
        coefficients[3::4, 0] += FLOORS_LOSS
        segments.append(replace(segment, coefficients=coefficients))
    return replace(plan, shape=replace(shape, high_words=True), segments=tuple(segments))


def _inverse_plan(plan: Plan, room: FloatArray, where: str) -> Plan:
    bits = choose_matrix_bits(plan.real, where)
    real = plan.real.copy()
    real[:, _MATRIX] *= 2.0**bits
    segments = _quantise(plan.segments, real, np.zeros(12))
    codes = plan.temp_codes
    functions = horner(segments, codes, segment_of(segments, codes)).reshape(-1, 3, 4)
    inverse, spare = choose_inverse(functions, room, bits, plan.shape, where)
    shape = replace(plan.shape, output_shift=32 + spare, inverse=inverse)
    return replace(plan, shape=shape, real=real, segments=segments)


def _with_quadratic(plan: Plan, per_g: FloatArray | None, where: str) -> Plan:
    if per_g is None:
        return plan
    spare = plan.shape.output_shift - 32
    words, real = quantise_quadratic(per_g, quadratic_log2(plan.shape.output_q, spare), where)
    return replace(plan, quadratic=words, real_quadratic=real)


_MATRIX = [f for f in range(12) if f % 4 < 3]


def _quantise(
    frames: tuple[Segment, ...], real: FloatArray, preload: FloatArray
) -> tuple[Segment, ...]:
    """Integer coefficients: half up, with 1/2 for every floor that follows them.

    The floor of a Horner step loses 1/2 on average; adding it to the coefficient centres the error.
    """
    order = real.shape[2] - 1
    segments = []
    for s, frame in enumerate(frames):
        integers = np.empty(real[s].shape, np.int64)
        for f in range(real.shape[1]):
            for k in range(order + 1):
                value = real[s, f, k] * 2.0**k + (0.5 if k < order else 0.0)
                integers[f, k] = round_half_up(value + (preload[f] if k == 0 else 0.0))
        segments.append(replace(frame, coefficients=integers))
    return tuple(segments)
