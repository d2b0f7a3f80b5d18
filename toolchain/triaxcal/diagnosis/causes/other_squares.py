"""Each output has terms in the squares of the force along the other axes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Parameter
from triaxcal.diagnosis.core.readings import Readings
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray

_TERMS = [(i, j) for i in range(3) for j in range(3) if i != j]


def _hypotheses(_known: Known) -> Iterator[Hypothesis]:
    yield Hypothesis(
        "",
        _without,
        tuple(Parameter(f"output {AXES[i]} from {AXES[j]}^2", "mg/g^2") for i, j in _TERMS),
        change="with the squares of the other axes' forces",
        log_prior=-4.0,  # 1 - y^2 - z^2 is an own square at 1 g: the simpler cause goes first
    )


def _without(readings: Readings, amplitudes: FloatArray) -> Readings:
    squares = np.zeros((3, 3))
    squares[tuple(np.transpose(_TERMS))] = amplitudes
    # In a check position the force is what the unit shows: three steps solve a + S a^2 = seen.
    seen = readings.force
    force = seen
    for _ in range(3):
        force = np.where(readings.test[:, None], seen, seen - force**2 @ squares.T)
    return readings.but(outputs=readings.outputs - force**2 @ squares.T)


ENTRY = Cause(
    name="other_squares",
    label="squares of the other axes",
    doc="The sensor is not linear: its outputs have terms in the squares of the other axes.",
    hypotheses=_hypotheses,
    apart="more than 1 g from own-axis squares, the unit turned on its face from a tilt of the rig",
    alike=("squareness",),
    rank=42,
)
