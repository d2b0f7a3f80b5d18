"""P1 (13): | |a| - g | of the fitted model at the unit's own dwells, and who is to blame.

This is checked before anything is generated: a wrong reading is reported as such, and not as a
curve that no integer can hold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.core.grouping import TemperatureGroup, group_dwells
from triaxcal.fitting.tilter.estimators import CONDITION_MAX
from triaxcal.model.metrological import (
    force_from_voltage,
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
    """Check every dwell of the working range against the unit's limits.

    Raises
    ------
    RefusedError
        When no dwell lies in the range, or one is beyond its limit: names the two positions that
        contradict the others, or else the thermal function.
    """
    dwells = dwells_in_range(unit, calibration.range_degc, measurements)
    if not dwells:
        low, high = calibration.range_degc
        raise RefusedError(
            f"{unit.source}, [thermal] range_degc",
            f"no dwell of {measurements.source} lies in {low:g} to {high:g} degC",
            expected="at least one, to check the result",
            remedy="widen the range, or omit it",
        )
    _refuse_singular_curve(unit, calibration)
    temps = np.array([d.temp_degc for d in dwells])
    voltages = np.array([d.voltage_v for d in dwells])
    linear = force_from_voltage(calibration.thermal.constants_at(temps), voltages)
    force = calibration.terms.force_g(linear, np.array([d.rate_k_per_s for d in dwells]))
    errors = np.abs(np.linalg.norm(force, axis=1) - unit.gravity_g)
    limits = np.array([unit.limits.at(t, unit.t0_degc)[0] for t in temps])
    worst = int((errors / limits).argmax())
    if errors[worst] <= limits[worst]:
        return
    blame = _largest_disagreement(unit, calibration, measurements)
    if blame.error_g > _SUSPICIOUS * limits[worst]:
        raise _contradiction(unit, measurements.source, blame, dwells[worst], float(errors[worst]))
    raise _too_simple(unit, calibration, measurements.source, dwells[worst], float(errors[worst]))


def _refuse_singular_curve(unit: UnitDescription, calibration: Calibration) -> None:
    temps = np.linspace(*calibration.range_degc, 257)
    K, _ = unpack_constants(calibration.thermal.constants_at(temps))
    scaled = K / np.linalg.norm(K, axis=2, keepdims=True)
    condition = np.linalg.cond(scaled)
    worst = int(condition.argmax())
    if condition[worst] > CONDITION_MAX:
        raise RefusedError(
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
    groups = group_dwells(measurements, unit.t0_degc)
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
    return (dwell.voltage_v - model) / np.abs(constants[[0, 4, 8]])


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
            "the thermal function does not follow the unit: choose a better one in [thermal], "
            "or measure at more temperatures"
        ),
    )


def _residual_and_limit(unit: UnitDescription, dwell: Dwell, error_g: float) -> tuple[str, str]:
    limit_g, key = unit.limits.at(dwell.temp_degc, unit.t0_degc)
    residual = (
        f"| |a| - g | = {error_g * 1e3:.4g} mg in {dwell.position} at {dwell.temp_degc:.4g} degC, "
        f"{error_g / limit_g:.3g} times the limit"
    )
    return residual, f"at most {limit_g * 1e3:g} mg ({key})"
