"""The sensor is turned against the case."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Undo
from triaxcal.diagnosis.core.readings import Readings
from triaxcal.diagnosis.core.turns import angle_and_axis, nearest_rotation, sensitivity
from triaxcal.model.types import FloatArray

LEAST_DEG = 3.0
LOG_VOLUME = -8.0
"""Of three angles against those of a usual sensor."""


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    turn = nearest_rotation(sensitivity(known.readings))
    if turn is None or np.linalg.det(turn) < 0.0:
        return
    degrees, _ = angle_and_axis(turn)
    if degrees < LEAST_DEG or np.abs(np.diag(turn)).min() > np.cos(np.radians(LEAST_DEG)):
        return  # nearly none, or half a turn about an axis
    yield Hypothesis(
        turned_by(turn),
        turned(turn),
        change="with the axes turned",
        log_prior=LOG_VOLUME,
    )


def turned_by(turn: FloatArray) -> str:
    """Angle and axis of a rotation in words."""
    degrees, axis = angle_and_axis(turn)
    words = ", ".join(f"{v:+.2f}" for v in axis)
    return f"{degrees:.3g} deg about ({words})"


def turned(turn: FloatArray) -> Undo:
    """Undo a turn of the sensor's axes against the case, shape (3, 3)."""

    def undo(readings: Readings, _amplitudes: FloatArray) -> Readings:
        force = np.where(readings.test[:, None], readings.force @ turn.T, readings.force)
        return readings.but(force=force)

    return undo


ENTRY = Cause(
    name="mounting",
    label="the sensor turned in its case",
    doc="The axes of the sensor are turned against those of the case by more than misalignment.",
    hypotheses=_hypotheses,
    apart="the drawing of the case",
    discrete=True,
    rank=35,
)
