"""Several complete runs of one unit in one file: used together, and how well they repeat.

At a temperature where every test position was measured n times, the k-th dwell of each position
belongs to run k. The runs' mean is fitted. Each run alone has constants of its own, brought to one
temperature along the fitted curves; their scatter about the mean, with n - 1 degrees of freedom at
each such temperature, is the repeatability of one run, noise included.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.grouping import TemperatureGroup
from triaxcal.fitting.core.judged import RunRepeatability
from triaxcal.fitting.tilter.estimators import constants_of, estimator_operators
from triaxcal.model.curves import ThermalModel
from triaxcal.model.metrological import sensitivities, unpack_constants, voltage_from_force
from triaxcal.model.positions import AXES, specific_force_g
from triaxcal.model.types import FloatArray
from triaxcal.readings.measurements import Dwell
from triaxcal.unit.description import UnitDescription


@dataclass(frozen=True)
class _Apart:
    """Two dwells in one position of two runs, and by how much of an output they differ, in g."""

    first: Dwell
    second: Dwell
    axis: str
    error_g: float


def repeatability(
    unit: UnitDescription, thermal: ThermalModel, groups: Sequence[TemperatureGroup]
) -> RunRepeatability | None:
    """Standard deviations of one run; None where no temperature was measured in more than one."""
    repeated = [g for g in groups if g.runs]
    if not repeated:
        return None
    operator = estimator_operators("equation-10", unit.gravity_g, None, 1)[0]
    squares, dof = np.zeros(3), 0
    for group in repeated:
        own = np.stack([constants_of(operator, v) for v in _brought(unit, thermal, group)])
        K, U0 = unpack_constants(own - own.mean(axis=0))
        scale = np.abs(np.diag(unpack_constants(own.mean(axis=0))[0]))
        relative = (K / scale[:, None]) ** 2
        diagonal = relative[:, range(3), range(3)]
        squares += [
            ((U0 / scale) ** 2).sum() / 3.0,
            diagonal.sum() / 3.0,
            (relative.sum() - diagonal.sum()) / 6.0,
        ]
        dof += len(own) - 1
    bias, factor, cross = np.sqrt(squares / dof).tolist()
    return RunRepeatability(
        runs=min(max(len(g.runs), 1) for g in groups),
        temperatures=len(repeated),
        dof=dof,
        bias_g=bias,
        scale_ratio=factor,
        cross_ratio=cross,
    )


def run_notes(found: RunRepeatability | None) -> tuple[str, ...]:
    """How well the runs repeat, for the user."""
    if found is None:
        return ()
    at = f"{found.temperatures} temperature{'s' * (found.temperatures != 1)}"
    sizes = (found.bias_g, found.scale_ratio, found.cross_ratio)
    bias, scale, cross = (f"{size * 1e3:.3g}" for size in sizes)
    words = (
        f"{at} measured in more than one complete run, used together; one run repeats its biases "
        f"to {bias} mg, its scale factors to {scale} mg at 1 g, its cross terms to {cross} mg at "
        f"1 g (standard deviations, {found.dof} degree{'s' * (found.dof != 1)} of freedom each)"
    )
    return (words,)


def contradictory_runs(
    unit: UnitDescription,
    source: str,
    thermal: ThermalModel,
    groups: Sequence[TemperatureGroup],
) -> RefusedError | None:
    """A refusal where runs at one temperature are farther from their mean than the limit there."""
    found = [(g, _farthest(unit, thermal, g)) for g in groups if g.runs]
    if not found:
        return None
    group, apart = max(found, key=lambda f: f[1].error_g / _limit(unit, f[0])[0])
    limit_g, key = _limit(unit, group)
    if apart.error_g / 2.0 <= limit_g:
        return None
    rows = sorted((apart.first.row, apart.second.row))
    return RefusedError(
        f"{source}, rows {rows[0]} and {rows[1]}",
        f"{len(group.runs)} runs at {group.temp_degc:.4g} degC contradict each other: "
        f"{apart.first.position} differs by {apart.error_g * 1e3:.4g} mg in output {apart.axis}",
        expected=f"runs within {limit_g * 1e3:g} mg ({key}) of their mean",
        remedy="check that both are of this unit and at this temperature, or remove one of them",
    )


def _limit(unit: UnitDescription, group: TemperatureGroup) -> tuple[float, str]:
    return unit.limits.at(group.temp_degc, unit.t0_degc)


def _farthest(unit: UnitDescription, thermal: ThermalModel, group: TemperatureGroup) -> _Apart:
    scale = sensitivities(thermal.constants_at(group.temp_degc))
    readings = _brought(unit, thermal, group) / scale
    low, high = readings.argmin(axis=0), readings.argmax(axis=0)
    spread = readings.max(axis=0) - readings.min(axis=0)
    d, axis = (int(k) for k in np.unravel_index(int(spread.argmax()), spread.shape))
    first, second = (group.runs[int(run[d, axis])][d] for run in (low, high))
    return _Apart(first, second, AXES[axis], float(spread[d, axis]))


def _brought(unit: UnitDescription, thermal: ThermalModel, group: TemperatureGroup) -> FloatArray:
    """Readings of the runs along the curves to the group's temperature, (runs, 6, 3), V."""
    at_group = thermal.constants_at(group.temp_degc)
    result = []
    for run in group.runs:
        for d in run:
            change = thermal.constants_at(d.temp_degc) - at_group
            force = specific_force_g(d.position, unit.gravity_g)
            result.append(d.voltage_v - voltage_from_force(change, force))
    return np.array(result).reshape(len(group.runs), 6, 3)
