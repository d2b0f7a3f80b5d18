"""One output is on another scale than the others."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.cause import Cause
from triaxcal.diagnosis.poses.causes.scale import POWERS, divided
from triaxcal.diagnosis.poses.core.cause import KnownPoses, PoseHypothesis
from triaxcal.model.positions import AXES
from triaxcal.poses.stated import near_1


def _hypotheses(known: KnownPoses) -> Iterator[PoseHypothesis]:
    span = np.ptp(known.readings.outputs, axis=0)
    for i, axis in enumerate(AXES):
        others = float(np.delete(span, i).max())
        for factor in POWERS:
            if not near_1(span[i] / factor / others):
                continue
            yield PoseHypothesis(
                f"output {axis} is {factor:g} times as large as the others",
                divided(factor, np.arange(3) == i),
                lines=known.readings.lines,
                change=f"with output {axis} divided by {factor:g}",
                places=3.0 * len(POWERS),
            )


ENTRY = Cause(
    name="output_scale",
    label="gain or full scale of one output",
    doc="The scale factor of one output is a power of two times that of the others.",
    hypotheses=_hypotheses,
    apart="the settings of the converter",
    discrete=True,
    rank=37,
)
