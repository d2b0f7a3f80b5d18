"""One output drifts over the whole time of measuring."""

from __future__ import annotations

from collections.abc import Iterator

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Parameter, Undo
from triaxcal.diagnosis.core.readings import Readings
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    rows = known.readings.rows
    if len(known.readings.blocks) < 2:
        return
    for i in range(3):
        yield Hypothesis(
            f"output {AXES[i]}",
            _steady(i, int(rows.min()), int(rows.max())),
            (Parameter("drift from the first row to the last", "mg", 2e3),),
            change=f"with a steady drift of output {AXES[i]}",
            places=3.0,
        )


def _steady(i: int, first: int, last: int) -> Undo:
    def undo(readings: Readings, amplitudes: FloatArray) -> Readings:
        changed = readings.outputs.copy()
        changed[:, i] -= amplitudes[0] * (2.0 * (readings.rows - first) / (last - first) - 1.0)
        return readings.but(outputs=changed)

    return undo


ENTRY = Cause(
    name="drift",
    label="one drifting output",
    doc="The bias of one output drifts steadily from the first row to the last.",
    hypotheses=_hypotheses,
    apart="the first temperature again at the end",
    rank=52,
    spoils=True,
)
