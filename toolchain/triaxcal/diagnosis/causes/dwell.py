"""One dwell is wrong: moved, touched, recorded too early."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Parameter, Undo
from triaxcal.diagnosis.core.readings import Readings
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    readings = known.readings
    for k in known.odd_dwells:
        row = readings.rows[k]
        place = f"{readings.positions[k]} at {readings.temps_degc[k]:.4g} degC (row {row})"
        outputs = range(3) if readings.test[k] else [int(np.abs(readings.force[k]).argmax())]
        for i in outputs:
            yield Hypothesis(
                f"{place}, output {AXES[i]}",
                shifted(int(row), (i,)),
                (Parameter(f"output {AXES[i]}"),),
                np.array([row]),
                f"without {readings.positions[k]} of row {row}",
                places=4.0 * len(readings),
            )
        if readings.test[k]:
            yield Hypothesis(
                place,
                shifted(int(row), (0, 1, 2)),
                tuple(Parameter(f"output {a}") for a in AXES),
                np.array([row]),
                f"without {readings.positions[k]} of row {row}",
                places=4.0 * len(readings),
            )


def shifted(row: int, outputs: tuple[int, ...]) -> Undo:
    """Undo a shift of outputs of one row."""

    def undo(readings: Readings, amplitudes: FloatArray) -> Readings:
        changed = readings.outputs.copy()
        for i, amplitude in zip(outputs, amplitudes, strict=True):
            changed[readings.rows == row, i] -= amplitude
        return readings.but(outputs=changed)

    return undo


ENTRY = Cause(
    name="dwell",
    label="one wrong dwell",
    doc="One dwell was disturbed: the unit moved, or had not come to rest.",
    hypotheses=_hypotheses,
    apart="the same position at the same temperature again",
    rank=10,
    spoils=True,
)
