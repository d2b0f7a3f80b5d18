"""An output does not answer to the force."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.cause import Cause
from triaxcal.diagnosis.poses.core.cause import KnownPoses, PoseHypothesis
from triaxcal.diagnosis.poses.core.readings import PoseReadings
from triaxcal.model.positions import AXES

_ANSWER_G = 0.05
"""An output that changes by less does not answer: poses that leave it alone are in a plane."""
_OTHERS_G = 0.5
PER_G = 2.0
"""Mean density of the length of two outputs, whose third is uniform: exp(mean of ln) is 2."""
NOT_IN_A_PLANE = 3.0
"""Ln of the odds against poses that somebody chose in a plane: one recording of 20 has them."""


def _hypotheses(known: KnownPoses) -> Iterator[PoseHypothesis]:
    readings = known.readings
    span = np.ptp(readings.outputs, axis=0)
    for i in range(3):
        if span[i] > 2 * _ANSWER_G or np.delete(span, i).min() < _OTHERS_G:
            continue
        yield without_output(readings, f"output {AXES[i]}", f"output {AXES[i]}", places=3.0)


def without_output(
    readings: PoseReadings, text: str, missing: str, places: float
) -> PoseHypothesis:
    """That an output says nothing: no |a| has a meaning without it."""
    return PoseHypothesis(
        text,
        lines=readings.lines,
        change=f"|a| is unknown without {missing}",
        places=places,
        unused=np.ones(len(readings), dtype=np.bool_),
        density_per_g=PER_G,
        log_prior=NOT_IN_A_PLANE,
    )


ENTRY = Cause(
    name="dead",
    label="an output that does not answer",
    doc="An output stays the same in every pose, and the others do not make up 1 g without it.",
    hypotheses=_hypotheses,
    apart="the unit turned by hand while the output is watched",
    discrete=True,
    rank=33,
    spoils=True,
)
