"""The biases drift from the first pose to the last."""

from __future__ import annotations

from collections.abc import Iterator

from triaxcal.diagnosis.core.cause import Cause, Parameter
from triaxcal.diagnosis.poses.causes.step import shifted
from triaxcal.diagnosis.poses.core.cause import KnownPoses, PoseHypothesis
from triaxcal.model.positions import AXES

_LEAST = 4


def _hypotheses(known: KnownPoses) -> Iterator[PoseHypothesis]:
    readings = known.readings
    if len(readings) < _LEAST:
        return
    yield PoseHypothesis(
        "",
        shifted(readings.order - 0.5),
        tuple(Parameter(f"output {axis}") for axis in AXES),
        readings.lines,
        "with a steady drift of the biases from the first pose to the last",
        sizes=(0.5e-3, 5e-3, 50e-3),
    )


ENTRY = Cause(
    name="drift",
    label="biases that drift",
    doc="The biases change steadily from the first pose to the last: the unit still warmed up.",
    hypotheses=_hypotheses,
    apart="some of the first poses again at the end",
    rank=51,
    spoils=True,
)
