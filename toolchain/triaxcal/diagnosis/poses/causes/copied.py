"""One output repeats another one."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from triaxcal.diagnosis.core.cause import Cause
from triaxcal.diagnosis.poses.causes.dead import without_output
from triaxcal.diagnosis.poses.core.cause import KnownPoses, PoseHypothesis
from triaxcal.model.positions import AXES

_LARGEST_G = 1e-3
_ANSWER_G = 0.5


def _hypotheses(known: KnownPoses) -> Iterator[PoseHypothesis]:
    readings = known.readings
    for i, j in combinations(range(3), 2):
        for sign in (1.0, -1.0):
            difference = readings.outputs[:, j] - sign * readings.outputs[:, i]
            if np.abs(difference).max() > _LARGEST_G or np.ptp(readings.outputs[:, i]) < _ANSWER_G:
                continue
            how = "repeats" if sign > 0.0 else "is the negative of"
            text = f"output {AXES[j]} {how} output {AXES[i]}"
            missing = f"output {AXES[i]} or {AXES[j]}"
            yield without_output(readings, text, missing, places=6.0)


ENTRY = Cause(
    name="copied",
    label="a copied output",
    doc="One output has the readings of another one: a column or a channel was read twice.",
    hypotheses=_hypotheses,
    apart="the wiring and the columns of the log",
    discrete=True,
    rank=34,
    spoils=True,
)
