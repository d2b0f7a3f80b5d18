"""The rig is not square: every position has a tilt of its own, the same at every temperature."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Parameter
from triaxcal.diagnosis.core.readings import FORCES, POSITIONS, Readings
from triaxcal.diagnosis.core.turns import rotation
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray

_LEVEL = [(p, k) for p in range(6) for k in range(3) if FORCES[p, k] == 0.0]


def _hypotheses(_known: Known) -> Iterator[Hypothesis]:
    yield Hypothesis(
        "",
        _square,
        tuple(Parameter(f"{POSITIONS[p]} about {AXES[k]}", "mrad") for p, k in _LEVEL),
        change="with a tilt of each position",
        sizes=(0.5e-3, 1.5e-3, 5e-3, 15e-3),
    )


def _square(readings: Readings, amplitudes: FloatArray) -> Readings:
    turns = np.zeros((6, 3))
    for (p, k), amplitude in zip(_LEVEL, amplitudes, strict=True):
        turns[p, k] = amplitude
    force = readings.force.copy()
    names = np.array(readings.positions)
    for name, turn in zip(POSITIONS, turns, strict=True):
        own = names == name
        force[own] = force[own] @ rotation(turn).T
    return readings.but(force=force)


ENTRY = Cause(
    name="squareness",
    label="squareness of the rig",
    doc="The faces of the rig are not square: each position is tilted, at every temperature.",
    hypotheses=_hypotheses,
    apart="the angles of the rig's faces; the unit turned on its face",
    alike=("other_squares", "own_square"),
    rank=21,
)
