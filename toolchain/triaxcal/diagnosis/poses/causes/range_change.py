"""The range of the sensor was changed between two poses."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.cause import Cause
from triaxcal.diagnosis.poses.causes.scale import POWERS, divided
from triaxcal.diagnosis.poses.core.cause import KnownPoses, PoseHypothesis

_NEAR = 0.2
"""Relative difference of lengths that biases and scale factors make."""


def _hypotheses(known: KnownPoses) -> Iterator[PoseHypothesis]:
    readings = known.readings
    count = len(readings)
    length = np.linalg.norm(readings.outputs, axis=1)
    for k in range(2, count - 1):
        ratio = float(np.median(length[k:]) / np.median(length[:k]))
        step = float(length[k] / length[k - 1])
        for factor in POWERS:
            if abs(ratio / factor - 1.0) > _NEAR or abs(step / factor - 1.0) > _NEAR:
                continue
            yield PoseHypothesis(
                f"from {readings.words(np.array([k]))} on they are {factor:g} times as large",
                divided(factor, (np.arange(count) >= k)[:, None]),
                lines=readings.lines[k:],
                change=f"with these readings divided by {factor:g}",
                places=float(len(POWERS) * count),
            )


ENTRY = Cause(
    name="range_change",
    label="a change of the sensor's range",
    doc="From one pose on all readings are a power of two times the others.",
    hypotheses=_hypotheses,
    apart="the settings of the sensor",
    discrete=True,
    rank=38,
    spoils=True,
)
