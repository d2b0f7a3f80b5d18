"""The biases drift over the whole time of measuring: steadily, or less and less."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Parameter, Undo
from triaxcal.diagnosis.core.readings import Readings
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray

_SHAPES = {"steadily": 0.0, "less and less": 4.0}
"""Time over which the whole measuring goes, in time constants; 0: a straight line."""


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    rows = known.readings.rows
    if len(known.readings.blocks) < 2:
        return
    outputs = [(0,), (1,), (2,), (0, 1, 2)]
    for words, constants in _SHAPES.items():
        for some in outputs:
            names = ", ".join(AXES[i] for i in some)
            several = "s" if len(some) > 1 else ""
            yield Hypothesis(
                f"output{several} {names} {words}",
                _steady(some, constants, int(rows.min()), int(rows.max())),
                tuple(Parameter(f"drift of {AXES[i]} over all rows", "mg", 2e3) for i in some),
                change=f"with output{several} {names} drifting {words}",
                places=float(len(outputs) * len(_SHAPES)),
            )


def _steady(some: tuple[int, ...], constants: float, first: int, last: int) -> Undo:
    def undo(readings: Readings, amplitudes: FloatArray) -> Readings:
        changed = readings.outputs.copy()
        time = (readings.rows - first) / (last - first)
        if constants:
            time = (1.0 - np.exp(-constants * time)) / (1.0 - np.exp(-constants))
        for i, amplitude in zip(some, amplitudes, strict=True):
            changed[:, i] -= amplitude * (2.0 * time - 1.0)
        return readings.but(outputs=changed)

    return undo


ENTRY = Cause(
    name="drift",
    label="drifting outputs",
    doc="Biases drift from the first row to the last, steadily or as a unit that settles.",
    hypotheses=_hypotheses,
    apart="the first temperature again at the end",
    rank=52,
    spoils=True,
)
