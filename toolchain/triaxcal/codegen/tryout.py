"""The compiled C on the unit's own dwells: | |a| - g | before and after, P1 (13), figures 5, 6."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.codegen.routines import Routine
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
    sensor = unit.temperature_sensor
    voltages = np.array([d.voltage_v for d in dwells])
    raw = np.rint(voltages / unit.adc.volts_per_code).clip(unit.adc.code_min, unit.adc.code_max)
    temp = np.array([sensor.code(d.temp_degc) for d in dwells])
    codes = temp.astype(np.int32), np.ascontiguousarray(raw.astype(np.int32))
    at_t0 = thermal.constants_at(unit.t0_degc)
    results = [_result(BEFORE, unit, dwells, force_from_voltage(at_t0, voltages))]
    for method, routine in ((METHODS[name], found) for name, found in routines.items()):
        if isinstance(routine, RefusedError):
            results.append(MethodResult(method, (), str(routine)))
            continue
        accel, status = routine(*codes)
        flagged = _flagged(source, method.label, dwells, status)
        if flagged is not None and method.name == unit.method:
            raise flagged
        if flagged is not None:
            results.append(MethodResult(method, (), str(flagged)))
            continue
        results.append(
            _result(method, unit, dwells, accel.astype(np.float64) * 2.0**-unit.output_q)
        )
    return tuple(results)


def _flagged(
    source: str,
    method: str,
    dwells: Sequence[Dwell],
    status: np.ndarray[tuple[int, ...], np.dtype[np.uint32]],
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
