"""One position of the rig is tilted, in the same way at every temperature."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Parameter, Undo
from triaxcal.diagnosis.core.readings import FORCES, POSITIONS, Readings
from triaxcal.diagnosis.core.turns import rotation
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray

_OF_THE_RIG = 2.0
"""Log probability against other causes: a stop out of place strikes every unit of the rig."""


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    readings = known.readings
    for name, force in zip(POSITIONS, FORCES, strict=True):
        own = np.array([p == name for p in readings.positions])
        if not own.any():
            continue
        level = [k for k in range(3) if force[k] == 0.0]
        yield Hypothesis(
            name,
            _tilted(name, level),
            tuple(Parameter(f"tilt about {AXES[k]}", "mrad") for k in level),
            readings.rows[own],
            f"with {name} tilted at every temperature",
            # Without check dwells a position and its opposite are one place.
            places=3.0 if readings.test.all() else 6.0,
            log_prior=_OF_THE_RIG,
            sizes=(2e-3, 20e-3, 200e-3),
        )


def _tilted(name: str, axes: list[int]) -> Undo:
    def undo(readings: Readings, amplitudes: FloatArray) -> Readings:
        angle = np.zeros(3)
        angle[axes] = amplitudes
        own = np.array([p == name for p in readings.positions])
        force = readings.force.copy()
        force[own] = force[own] @ rotation(angle).T
        return readings.but(force=force)

    return undo


ENTRY = Cause(
    name="misplaced",
    label="one position tilted at every temperature",
    doc="A face or stop of the rig is not where it should be: measuring again repeats it.",
    hypotheses=_hypotheses,
    apart="check dwells, which tell a position from its opposite; the angle of the stop itself",
    rank=20,
    spoils=True,
)
