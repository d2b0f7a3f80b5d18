"""The compiled C on the unit's own dwells: | |a| - g | before and after, P1 (13), figures 5, 6.

A dwell is a mean of readings, and lies between codes. The C takes whole codes: it is run at the
codes on both sides of the mean, of each axis and of the temperature, and its answers are
interpolated. Their weights are positive and add up to 1, so the error of the arithmetic is at most
that of one answer. The C is linear between neighbouring codes but for products of a code's own
size, 1e-3 g squared times 1e-2 g/g^2 at most. The rounding of one reading to a code is no error of
the C: it stands in the uncertainty's budget.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

from triaxcal.base.errors import RefusedError
from triaxcal.codegen.routines import Answers, Int32Array, Routine
from triaxcal.fixedpoint.integer_model import STATUS_OK
from triaxcal.fixedpoint.plan import Plan
from triaxcal.fixedpoint.quadratic import quadratic_log2
from triaxcal.model.curves import ThermalModel
from triaxcal.model.methods.method import Column
from triaxcal.model.methods.registry import METHODS
from triaxcal.model.metrological import (
    exact_gain_and_offset,
    force_from_voltage,
    worst_force_error_g,
)
from triaxcal.model.terms import products
from triaxcal.model.types import FloatArray
from triaxcal.readings.measurements import Dwell
from triaxcal.unit.description import UnitDescription

_WHOLE = 1e-6
"""Of a code: a mean this near to a whole one is that code."""
BEFORE = Column(
    name="before",
    label="before",
    doc="the model with the constants of T0",
    short_label="before",
    colour="#8a8a8a",
)
"""Readings that are not compensated over temperature."""


@dataclass(frozen=True)
class Residual:
    """|a| - g at one dwell, in g."""

    dwell: Dwell
    error_g: float


@dataclass(frozen=True)
class MethodResult:
    """Residuals of one method, in the order of the dwells; empty when it was refused, and why."""

    method: Column
    residuals: tuple[Residual, ...]
    refusal: str


def run_on_dwells(
    unit: UnitDescription,
    thermal: ThermalModel,
    source: str,
    dwells: Sequence[Dwell],
    routines: Mapping[str, Routine | RefusedError],
) -> tuple[MethodResult, ...]:
    """Residuals before compensation (constants of T0), then of each routine.

    `dwells` of the file `source` lie in the working range.

    Raises
    ------
    RefusedError
        When the unit's own method flags one of its dwells.
    """
    voltages = np.array([d.voltage_v for d in dwells])
    exact = exact_codes(unit, voltages, np.array([d.temp_degc for d in dwells]))
    exact[:, 1:] = exact[:, 1:].clip(unit.adc.code_min, unit.adc.code_max)
    corners = list(corners_of(exact))
    at_t0 = thermal.constants_at(unit.t0_degc)
    results = [_result(BEFORE, unit, dwells, force_from_voltage(at_t0, voltages))]
    for method, routine in ((METHODS[name], found) for name, found in routines.items()):
        if isinstance(routine, RefusedError):
            results.append(MethodResult(method, (), str(routine)))
            continue
        accel, status = between_codes(routine, corners)
        flagged = _flagged(source, method.label, dwells, status)
        if flagged is not None and method.name == unit.method:
            raise flagged
        if flagged is not None:
            results.append(MethodResult(method, (), str(flagged)))
            continue
        results.append(_result(method, unit, dwells, accel * 2.0**-unit.output_q))
    return tuple(results)


Corner = tuple[Int32Array, Int32Array, FloatArray]
"""Temperature codes (n,), raw codes (n, 3), and the weights (n,) of the C's answers there."""


def exact_codes(unit: UnitDescription, readings: FloatArray, temps_degc: FloatArray) -> FloatArray:
    """Temperatures (n,) and readings (n, 3) in codes, not rounded, (n, 4)."""
    sensor = unit.temperature_sensor
    temp = (temps_degc - sensor.degc_at_zero) / sensor.degc_per_code
    return np.column_stack([temp, readings / unit.adc.volts_per_code])


def corners_of(exact: FloatArray) -> Iterator[Corner]:
    """Codes on both sides of `exact_codes` (n, 4), where any of them has weight."""
    # Voltages of whole codes come back with the rounding of a division.
    whole = np.abs(exact - np.rint(exact)) < _WHOLE
    below = np.where(whole, np.rint(exact), np.floor(exact))
    above = exact - below
    above[whole] = 0.0
    for side in product((False, True), repeat=4):
        weight = np.where(side, above, 1.0 - above).prod(axis=1)
        if weight.any():
            # Where a side has no weight its code may not exist.
            codes = np.where(weight[:, None] > 0.0, below + np.array(side), np.rint(exact))
            codes = codes.astype(np.int32)
            temp_code, raw_code = (np.ascontiguousarray(c) for c in (codes[:, 0], codes[:, 1:]))
            yield temp_code, raw_code, weight


def between_codes(
    routine: Routine, corners: Sequence[Corner]
) -> tuple[FloatArray, npt.NDArray[np.uint32]]:
    """Interpolated accelerations (n, 3) in LSB, and every status bit that a side has set."""
    accel = np.zeros((len(corners[0][2]), 3))
    status = np.zeros(len(accel), dtype=np.uint32)
    for temp, raw, weight in corners:
        found: Answers = routine(temp, raw)
        accel += weight[:, None] * found[0]
        status |= np.where(weight > 0.0, found[1], 0).astype(np.uint32)
    return accel, status


def _flagged(
    source: str,
    method: str,
    dwells: Sequence[Dwell],
    status: npt.NDArray[np.uint32],
) -> RefusedError | None:
    # A dwell half a code beyond an end of the range is clamped to it by intention.
    flagged = np.flatnonzero(status & ~np.uint32(3))
    if not len(flagged):
        return None
    return RefusedError(
        f"{source}, row {dwells[int(flagged[0])].row}",
        f"the compiled C flags this dwell with status {status[flagged[0]]} (method {method})",
        expected=f"status {STATUS_OK}",
        remedy="check adc.code_min, adc.code_max and compensation.output_q",
    )


def _result(
    method: Column, unit: UnitDescription, dwells: Sequence[Dwell], force_g: FloatArray
) -> MethodResult:
    errors = np.linalg.norm(force_g, axis=1) - unit.gravity_g
    residuals = tuple(Residual(d, float(e)) for d, e in zip(dwells, errors, strict=True))
    return MethodResult(method, residuals, "")


def model_error_g(unit: UnitDescription, thermal: ThermalModel, plan: Plan) -> float:
    """Largest error of the plan's real functions against K(T)^-1 (U - U0(T)), in g.

    Over every temperature code of the range and every raw code of the declared range.
    """
    rows = plan.real_rows()
    shape = plan.shape
    gain_unit = 2.0 ** -(shape.output_q + shape.output_shift)
    gain = rows[:, :, :3] * (gain_unit / plan.volts_per_lsb)
    offset = rows[:, :, 3] * (gain_unit * 2.0**32)
    sensor = unit.temperature_sensor
    temps = plan.temp_codes.astype(np.float64) * sensor.degc_per_code + sensor.degc_at_zero
    exact = exact_gain_and_offset(thermal.constants_at(temps))
    voltage_max_v = shape.raw_box * plan.volts_per_lsb
    error = worst_force_error_g((gain, offset), exact, voltage_max_v)
    if plan.real_quadratic is not None:
        # The same Q of an l that is e off: |p(l + e) - p(l)| <= p(|l| + |e|) - p(|l|).
        log2 = quadratic_log2(shape.output_q, shape.output_shift - 32)
        per_g = np.abs(plan.real_quadratic) * 2.0**-log2
        reach = np.abs(exact[0]).sum(axis=-1) * voltage_max_v + np.abs(exact[1])
        error = error + (products(reach + error) - products(reach)) @ per_g.T
    return float(error.max())
