"""Poses of a recording as arrays in units of g, in the order in which they were recorded."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from triaxcal.diagnosis.core.readings import in_runs
from triaxcal.fitting.recorded.prepared import Prepared
from triaxcal.model.types import FloatArray, IntArray
from triaxcal.poses.poseset import PoseSet


@dataclass(frozen=True)
class PoseReadings:
    """Poses of one unit.

    Attributes
    ----------
    numbers, lines : arrays of int, shape (n,)
        Of each pose, as `triaxcal poses` prints them.
    outputs : array, shape (n, 3)
        Readings less those of 0 g, by `one_g`.
    longer_g : array, shape (n,)
        By how much |a| is longer than g for another reason than the constants.
    weight : array, shape (n,)
        Square roots of the weights.
    count : array, shape (n,)
        For how many values a pose counts.
    order : array, shape (n,)
        When it was recorded, from 0 to 1.
    gravity_g : float
    one_g : float
        Reading of 1 g: the nominal one where the unit of the readings has one, else about.
    nominal : bool
        Whether it is the nominal one.
    """

    numbers: IntArray
    lines: IntArray
    outputs: FloatArray
    longer_g: FloatArray
    weight: FloatArray
    count: FloatArray
    order: FloatArray
    gravity_g: float
    one_g: float
    nominal: bool

    def __len__(self) -> int:
        return len(self.outputs)

    def but(self, **changes: object) -> PoseReadings:
        """The same with other arrays."""
        return replace(self, **changes)  # type: ignore[arg-type]

    def words(self, some: IntArray) -> str:
        """Poses by number and line: "pose 3 (line 120)"; of many the numbers, in runs."""
        named = [f"pose {self.numbers[k]} (line {self.lines[k]})" for k in some]
        if len(named) > _NAMED:
            return f"poses {in_runs(self.numbers[some])}"
        return " and ".join(filter(None, [", ".join(named[:-1]), named[-1]]))


_NAMED = 6


def pose_readings(poses: PoseSet, found: Prepared) -> PoseReadings:
    """Poses in units of g."""
    nominal, data = found.known.nominal, found.data
    one_g = data.radius / data.gravity_g if nominal is None else nominal
    count = len(poses.poses)
    times = np.array([pose.start_s for pose in poses.poses])
    if not np.ptp(times) > 0.0:
        times = np.arange(count, dtype=np.float64)
    return PoseReadings(
        numbers=np.array([pose.number for pose in poses.poses]),
        lines=np.array([pose.line for pose in poses.poses]),
        outputs=(poses.readings - found.known.zero) / one_g,
        longer_g=np.zeros(count),
        weight=data.weight,
        count=data.count,
        order=(times - times[0]) / max(float(np.ptp(times)), 1e-9),
        gravity_g=data.gravity_g,
        one_g=one_g,
        nominal=nominal is not None,
    )
