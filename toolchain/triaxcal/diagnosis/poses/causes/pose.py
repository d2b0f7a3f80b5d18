"""One pose is wrong: moved during its rest, pushed by a hand, or on another scale."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Parameter
from triaxcal.diagnosis.core.evidence import FAULT_LOG_ODDS
from triaxcal.diagnosis.poses.core.cause import KnownPoses, PoseHypothesis, PoseUndo
from triaxcal.diagnosis.poses.core.readings import PoseReadings
from triaxcal.fitting.recorded.wrong import WRONG_LOG_ODDS
from triaxcal.model.types import FloatArray

MORE_OFTEN = WRONG_LOG_ODDS - FAULT_LOG_ODDS
"""Wrong poses are more probable than other causes."""


def longer(some: Sequence[int]) -> PoseUndo:
    """Undo shifts of |a|, one a pose."""

    def undo(readings: PoseReadings, amplitudes: FloatArray) -> PoseReadings:
        changed = readings.longer_g.copy()
        changed[list(some)] += amplitudes
        return readings.but(longer_g=changed)

    return undo


def _hypotheses(known: KnownPoses) -> Iterator[PoseHypothesis]:
    readings = known.readings
    for k in known.odd:
        yield PoseHypothesis(
            readings.words(np.array([k])),
            longer([k]),
            (Parameter("|a| - g"),),
            readings.lines[[k]],
            "without it",
            places=float(len(readings)),
            log_prior=MORE_OFTEN,
        )


ENTRY = Cause(
    name="pose",
    label="one wrong pose",
    doc="The unit moved during one pose, a hand pushed it, or its readings are on another scale.",
    hypotheses=_hypotheses,
    apart="the same orientation again",
    rank=10,
    spoils=True,
)
