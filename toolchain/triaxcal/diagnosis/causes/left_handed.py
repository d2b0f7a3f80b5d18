"""The outputs are those of a left-handed triad: two columns are exchanged."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.causes.mounting import LOG_VOLUME, turned
from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, falling
from triaxcal.diagnosis.core.turns import nearest_rotation, sensitivity
from triaxcal.model.positions import AXES

_PLAIN = 0.95
"""Least direction cosine of outputs that are exchanged and not turned."""


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    K = sensitivity(known.readings)
    # Without a stated polarity two exchanged columns of a falling sensor look like half a turn.
    for sign in (1.0,) if known.readings.polarity else (1.0, -1.0):
        turn = nearest_rotation(sign * K)
        if turn is None or np.linalg.det(turn) > 0.0:
            continue
        largest = np.abs(turn).argmax(axis=1)
        if (largest == np.arange(3)).all():
            continue  # an inverted output: polarity
        if sign < 0.0 and turn[np.arange(3), largest].min() < _PLAIN:
            continue  # a turned sensor
        names = ", ".join(
            f"{AXES[i]} answers to {'-' if turn[i, largest[i]] < 0 else ''}{AXES[largest[i]]}"
            for i in range(3)
            if largest[i] != i
        )
        undo = turned(turn)
        yield Hypothesis(
            f"output {names}" + ", all sensitivities being negative" * (sign < 0.0),
            undo if sign > 0.0 else falling(undo),
            change="with these columns exchanged",
            log_prior=LOG_VOLUME / 2.0,
        )


ENTRY = Cause(
    name="left_handed",
    label="left-handed axes: outputs exchanged",
    doc="Two outputs stand in each other's columns.",
    hypotheses=_hypotheses,
    apart="the wiring and the columns of the log",
    discrete=True,
    rank=36,
    spoils=True,
)
