"""Several poses are wrong, each in its own way."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Parameter
from triaxcal.diagnosis.core.evidence import FAULT_LOG_ODDS
from triaxcal.diagnosis.poses.causes.pose import longer
from triaxcal.diagnosis.poses.core.cause import KnownPoses, PoseHypothesis
from triaxcal.fitting.recorded.wrong import log_prior


def _hypotheses(known: KnownPoses) -> Iterator[PoseHypothesis]:
    readings, wrong = known.readings, known.wrong
    if wrong is None or len(wrong.indices) < 2:
        return
    some = np.sort(wrong.indices)
    yield PoseHypothesis(
        readings.words(some),
        longer(some.tolist()),
        tuple(Parameter(f"pose {readings.numbers[k]}") for k in some),
        readings.lines[some],
        "without them",
        log_prior=log_prior(len(readings), len(some)) - FAULT_LOG_ODDS,
    )


ENTRY = Cause(
    name="poses",
    label="several wrong poses",
    doc="Some poses differ from the others, each in its own way.",
    hypotheses=_hypotheses,
    apart="the same orientations again",
    rank=11,
    spoils=True,
)
