"""Poses made ready for the fit: scaled, weighed, grouped, and what they cannot tell."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.noise import NOISE
from triaxcal.fitting.recorded.checks import (
    clipped_findings,
    crowd_finding,
    open_finding,
    refuse_left_handed,
    refuse_no_numbers,
)
from triaxcal.fitting.recorded.prior import Known, reading_of_zero
from triaxcal.fitting.recorded.scalar import ScalarData, scalar_data, unscaled_data
from triaxcal.fitting.recorded.temperatures import temperature_findings, temperature_groups
from triaxcal.model.types import FloatArray
from triaxcal.poses.poses import PoseSet, orientation_groups
from triaxcal.readings.samples import Samples
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.recording import RecordingLayout

_COMMON_G = 5e-4
"""Noise that every pose is given beside its own scatter when poses are weighed."""


@dataclass(frozen=True)
class Prepared:
    """Scaled poses, their temperatures, what is known beforehand, and what has been found.

    `one_way` says that all poses point alike.
    """

    data: ScalarData
    temps: FloatArray
    known: Known
    orientations: list[list[int]]
    temperatures: list[list[int]]
    findings: list[str]
    one_way: bool


def prepare(
    unit: UnitDescription, layout: RecordingLayout, samples: Samples, poses: PoseSet
) -> Prepared:
    """Scale the poses, weigh them, and say what they cannot tell.

    Raises
    ------
    RefusedError
        For left-handed axes, and what is no number.
    """
    found = weighed(unit, layout, poses)
    axes = refuse_left_handed(samples, layout, found.data.centre)
    return replace(found, findings=[*found.findings, axes])


def weighed(unit: UnitDescription, layout: RecordingLayout, poses: PoseSet) -> Prepared:
    """The same without what samples between the poses say of the axes."""
    findings = [*poses.findings, *clipped_findings(poses, layout)]
    refuse_no_numbers(poses)
    recorded = poses.temps_degc
    temps = np.full(len(poses.poses), unit.t0_degc) if recorded is None else recorded
    ones = np.ones(len(temps))
    rough = scalar_data(poses.readings, ones[:, None], ones, unit.gravity_g)
    left_open, spans = open_finding(poses, rough.radius, unit.priors)
    if left_open:
        findings.append(left_open)
        rough = unscaled_data(poses.readings, ones[:, None], ones, unit.gravity_g)
    orientations, temperatures = orientation_groups(_directions(rough)), temperature_groups(temps)
    crowd = crowd_finding(orientations, poses)
    if crowd:
        findings.append(crowd)
    findings += temperature_findings(unit, recorded)
    count = ones.copy()
    for group in _cells(orientations, temps):
        count[group] = 1.0 / len(group)
    zero = reading_of_zero(unit.priors, rough, all_round=not left_open)
    own, least_sd = _own_weights(poses)
    known = Known(unit.priors, layout.reading_of_1_g, zero, NOISE.beside(least_sd))
    data = replace(rough, weight=np.sqrt(count * own), count=count)
    return Prepared(data, temps, known, orientations, temperatures, findings, spans < 2)


def _own_weights(poses: PoseSet) -> tuple[FloatArray, float]:
    """Weights of the poses by their own scatter, at most 1, and the least scatter, in g."""
    sd = poses.length_sd
    if sd is None:
        return np.ones(len(poses.poses)), 0.0
    sd = np.minimum(sd / poses.reading_of_1_g, 1.0)
    variance = _COMMON_G**2 + sd**2
    if not np.isfinite(variance).all():
        k = int(np.flatnonzero(~np.isfinite(variance))[0])
        raise RefusedError(
            f"{poses.source}, line {poses.poses[k].line}",
            f"the scatter of pose {poses.poses[k].number}, its weight, is no number",
            expected="a finite scatter",
            remedy="remove that pose",
        )
    weights: FloatArray = variance.min() / variance
    return weights, float(sd.min())


def _directions(data: ScalarData) -> FloatArray:
    unit: FloatArray = data.reading / np.linalg.norm(data.reading, axis=1, keepdims=True)
    return unit


def _cells(orientations: list[list[int]], temps: FloatArray) -> list[list[int]]:
    """Poses alike in orientation and temperature: they say one thing, and count as one."""
    return [
        [group[k] for k in cell]
        for group in orientations
        for cell in temperature_groups(temps[group])
    ]
