"""Something that is not in the list: the poses scatter far more than those of sensors do."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from triaxcal.diagnosis.core.cause import Cause
from triaxcal.diagnosis.poses.core.cause import KnownPoses, PoseHypothesis
from triaxcal.fitting.core.noise import NOISE

_TIMES = (10.0, 100.0, 600.0)


def _hypotheses(_known: KnownPoses) -> Iterator[PoseHypothesis]:
    for times in _TIMES:
        yield PoseHypothesis(
            "",
            change="nothing",
            places=float(len(_TIMES)),
            noise=replace(NOISE, median=times * NOISE.median),
        )


ENTRY = Cause(
    name="unknown",
    label="unknown",
    doc="No cause of the list explains the poses: their lengths scatter far more than usual.",
    hypotheses=_hypotheses,
    apart="the same poses again",
    discrete=True,
    symptom=True,
    rank=999,
)
