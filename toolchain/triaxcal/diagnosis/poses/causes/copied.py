"""One output repeats another one."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from triaxcal.diagnosis.core.cause import Cause
from triaxcal.diagnosis.poses.causes.dead import NOT_IN_A_PLANE, PER_G
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
            yield PoseHypothesis(
                f"output {AXES[j]} {how} output {AXES[i]}",
                lines=readings.lines,
                change=f"|a| is unknown without output {AXES[i]} or {AXES[j]}",
                places=6.0,
                unused=np.ones(len(readings), dtype=np.bool_),
                density_per_g=PER_G,
                log_prior=NOT_IN_A_PLANE,
            )


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
