"""Whether a fitted model keeps the unit's limits: on readings of the fit, and on those outside it.

Every dwell is held against the limit that holds at its temperature, P1 (13): | |a| - g |. Check
dwells have not been fitted. Temperatures held out in turn show the curves between the calibrated
temperatures, which the limit over the range is for; at T0 as elsewhere, because the delivered
curves are fitted there. So

    | |a| - g |  at each dwell             <= limits.at_t0_g within 2 degC of T0, else over_range_g
    r | |a| - g | at each dwell held out   <= limits.over_range_g
    r times the rms error of a component   <= limits.over_range_g

with r of `fitting.tilter.heldout`: 1, or less where only a smaller function could be held out.
All is checked before anything is generated, and `unacceptable` alone says what is refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.core.grouping import TemperatureGroup, group_dwells
from triaxcal.fitting.tilter.estimators import CONDITION_MAX
from triaxcal.fitting.tilter.resolution import limit_below_a_code
from triaxcal.fitting.tilter.runs import contradictory_runs
from triaxcal.fitting.tilter.squares import straight
from triaxcal.model.metrological import (
    force_from_voltage,
    sensitivities,
    unpack_constants,
    voltage_from_force,
)
from triaxcal.model.positions import AXES, specific_force_g
from triaxcal.model.types import FloatArray
from triaxcal.readings.measurements import Dwell, MeasurementSet
from triaxcal.unit.description import UnitDescription

_OPPOSITES = (("TP6", "TP5"), ("TP4", "TP2"), ("TP1", "TP3"))
_SUSPICIOUS = 0.5
"""Of the limit: positions that disagree by more explain a residual beyond the limit."""


@dataclass(frozen=True)
class _Disagreement:
    """Two opposite positions whose mean output is not that of the other four, in g."""

    group: TemperatureGroup
    positions: tuple[str, str]
    axis: str
    error_g: float


def refuse_unacceptable(
    unit: UnitDescription, calibration: Calibration, measurements: MeasurementSet
) -> None:
    """Refuse a calibration that misses a limit.

    Raises
    ------
    RefusedError
        What `unacceptable` finds.
    """
    refusal = unacceptable(unit, calibration, measurements)
    if refusal is not None:
        raise refusal


def unacceptable(
    unit: UnitDescription, calibration: Calibration, measurements: MeasurementSet
) -> RefusedError | None:
    """Why a calibration may not be delivered; None where it keeps the limits.

    Positions that contradict each other at one temperature come first: no curve is to blame for
    them. Then what was held out, then the dwells of the fit.
    """
    dwells = dwells_in_range(unit, calibration.range_degc, measurements)
    if not dwells:
        low, high = calibration.range_degc
        return RefusedError(
            f"{unit.source}, [thermal] range_degc",
            f"no dwell of {measurements.source} lies in {low:g} to {high:g} degC",
            expected="at least one, to check the result",
            remedy="widen the range, or omit it",
        )
    groups = group_dwells(measurements, unit.t0_degc)
    first = (
        _singular_curve(unit, calibration)
        or limit_below_a_code(unit, calibration, measurements)
        or contradictory_runs(unit, measurements.source, calibration.thermal, groups)
    )
    if first is not None:
        return first
    errors = dwell_errors_g(unit, calibration, dwells)
    limits = np.array([unit.limits.at(d.temp_degc, unit.t0_degc)[0] for d in dwells])
    worst = int((errors / limits).argmax())
    if errors[worst] > limits[worst]:
        blame = _largest_disagreement(unit, calibration, measurements)
        if blame.error_g > _SUSPICIOUS * limits[worst]:
            return _contradiction(
                unit, measurements.source, blame, dwells[worst], float(errors[worst])
            )
    test = calibration.held_out
    share = 1.0 if test is None else test.share
    held_out = held_out_refusal(unit, calibration, measurements.source, share)
    if held_out is not None:
        return held_out
    if errors[worst] > limits[worst]:
        return _too_simple(
            unit, calibration, measurements.source, dwells[worst], float(errors[worst])
        )
    return None


def dwell_errors_g(
    unit: UnitDescription, calibration: Calibration, dwells: Sequence[Dwell]
) -> FloatArray:
    """| |a| - g | of the fitted model at dwells, shape (n,), in g."""
    temps = np.array([d.temp_degc for d in dwells], dtype=np.float64)
    voltages = np.array([d.voltage_v for d in dwells], dtype=np.float64).reshape(-1, 3)
    linear = force_from_voltage(calibration.thermal.constants_at(temps), voltages)
    force = calibration.terms.force_g(linear, np.array([d.rate_k_per_s for d in dwells]))
    result: FloatArray = np.abs(np.linalg.norm(force, axis=1) - unit.gravity_g)
    return result


def held_out_refusal(
    unit: UnitDescription, calibration: Calibration, source: str, share: float
) -> RefusedError | None:
    """A temperature held out whose dwells the curves without it miss.

    `share` of the error is held against the limit: that of the delivered curves, or 1.
    """
    test, limit = calibration.held_out, unit.limits.over_range_g
    if test is None or test.worst is None or test.rms_g is None:
        return None
    worst, rms = test.worst, share * test.rms_g
    error = share * abs(worst.error_g)
    if max(error, rms) <= limit:
        return None
    found = (
        f"| |a| - g | = {abs(worst.error_g) * 1e3:.4g} mg in {worst.position} at "
        f"{worst.temp_degc:.4g} degC held out, by {test.function} fitted without it"
    )
    if error <= limit:
        found = (
            f"with each inner temperature held out in turn, {test.function} misses the components "
            f"of the force by {test.rms_g * 1e3:.4g} mg rms"
        )
    if share < 1.0:
        found += (
            f"; the delivered {calibration.shape.label} is estimated to have {share:.2g} of that"
        )
    return RefusedError(
        f"{source}, row {worst.row}",
        f"{found}, {max(error, rms) / limit:.3g} times the limit",
        expected=f"at most {limit * 1e3:g} mg (limits.over_range_g)",
        remedy=(
            "the temperatures contradict each other, or the thermal function does not follow the "
            "unit: check sign, unit and order of the temperatures, choose another function in "
            "[thermal], or measure at more temperatures"
        ),
    )


def _singular_curve(unit: UnitDescription, calibration: Calibration) -> RefusedError | None:
    temps = np.linspace(*calibration.range_degc, 257)
    K, _ = unpack_constants(calibration.thermal.constants_at(temps))
    scaled = K / np.linalg.norm(K, axis=2, keepdims=True)
    condition = np.linalg.cond(scaled)
    worst = int(condition.argmax())
    if condition[worst] <= CONDITION_MAX:
        return None
    return RefusedError(
        f"{unit.source}, [thermal]",
        f"{calibration.shape.label} makes K singular or nearly so at {temps[worst]:.4g} degC "
        f"(condition number {condition[worst]:.3g})",
        expected=f"a condition number of at most {CONDITION_MAX:g} over the whole range",
        remedy="choose another thermal function, or measure at a temperature near it",
    )


def dwells_in_range(
    unit: UnitDescription, range_degc: tuple[float, float], measurements: MeasurementSet
) -> list[Dwell]:
    """Dwells whose temperature code lies in the working range, in the order of the file."""
    half_code = 0.5 * unit.temperature_sensor.degc_per_code
    low, high = range_degc[0] - half_code, range_degc[1] + half_code
    return [d for d in measurements.dwells if low <= d.temp_degc <= high]


def _largest_disagreement(
    unit: UnitDescription, calibration: Calibration, measurements: MeasurementSet
) -> _Disagreement:
    groups = straight(group_dwells(measurements, unit.t0_degc), calibration.terms, unit.gravity_g)
    found = []
    for group, point in zip(groups, calibration.points, strict=True):
        residual = {
            d.position: _residual_g(d, point.constants, unit.gravity_g) for d in group.dwells
        }
        for pair in _OPPOSITES:
            mean = (residual[pair[0]] + residual[pair[1]]) / 2
            others = [r for p, r in residual.items() if p not in pair]
            difference = np.abs(mean - np.mean(others, axis=0))
            axis = int(difference.argmax())
            found.append(_Disagreement(group, pair, AXES[axis], float(difference[axis])))
    return max(found, key=lambda d: d.error_g)


def _residual_g(dwell: Dwell, constants: FloatArray, gravity_g: float) -> FloatArray:
    """Output less the model at one temperature, by the output's own scale factor, (3,), g."""
    model = voltage_from_force(constants, specific_force_g(dwell.position, gravity_g))
    return (dwell.voltage_v - model) / sensitivities(constants)


def _contradiction(
    unit: UnitDescription, source: str, blame: _Disagreement, dwell: Dwell, error_g: float
) -> RefusedError:
    residual, limit = _residual_and_limit(unit, dwell, error_g)
    row = {d.position: d.row for d in blame.group.dwells}
    first, second = sorted(blame.positions)
    return RefusedError(
        f"{source}, rows {row[first]} and {row[second]}",
        f"{residual}; at {blame.group.temp_degc:.4g} degC the mean of {first} and {second} differs "
        f"from that of the other four positions by {blame.error_g * 1e3:.4g} mg in output "
        f"{blame.axis}",
        expected=limit,
        remedy=(
            "the mean of opposite positions is the bias, so one of the two is wrong, or noise and "
            "placement are too large for this limit: measure both again"
        ),
    )


def _too_simple(
    unit: UnitDescription, calibration: Calibration, source: str, dwell: Dwell, error_g: float
) -> RefusedError:
    residual, limit = _residual_and_limit(unit, dwell, error_g)
    return RefusedError(
        f"{source}, row {dwell.row}",
        f"{residual}, with {calibration.shape.label}",
        expected=limit,
        remedy=(
            "noise, placement or a thermal function that does not follow the unit: measure that "
            "dwell again, for longer, or choose another function in [thermal], or measure at more "
            "temperatures"
        ),
    )


def _residual_and_limit(unit: UnitDescription, dwell: Dwell, error_g: float) -> tuple[str, str]:
    limit_g, key = unit.limits.at(dwell.temp_degc, unit.t0_degc)
    residual = (
        f"| |a| - g | = {error_g * 1e3:.4g} mg in {dwell.position} at {dwell.temp_degc:.4g} degC, "
        f"{error_g / limit_g:.3g} times the limit"
    )
    return residual, f"at most {limit_g * 1e3:g} mg ({key})"
