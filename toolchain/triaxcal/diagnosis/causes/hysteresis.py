"""The biases differ between heating and cooling, or between tests and checks."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Parameter, Undo
from triaxcal.diagnosis.core.readings import Readings
from triaxcal.model.positions import AXES
from triaxcal.model.types import BoolArray, FloatArray

BIASES = tuple(Parameter(f"bias of {a}") for a in AXES)


def _checks(readings: Readings) -> BoolArray:
    return ~readings.test


def _cooling(readings: Readings) -> BoolArray:
    found: BoolArray = readings.rising < 0
    return found


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    readings = known.readings
    checks, cooling = _checks(readings), _cooling(readings)
    sides = []
    if checks.any():
        sides.append((_checks, "checks and tests differ"))
    if 0 < cooling.sum() < len(cooling) and not np.array_equal(cooling, checks):
        sides.append((_cooling, "cooling and heating differ"))
    for side, words in sides:
        yield Hypothesis(
            f"{words} by one bias at every temperature",
            biased(side),
            BIASES,
            readings.rows[side(readings)],
            "without that bias",
            places=float(len(sides)),
        )


def biased(side: Callable[[Readings], BoolArray]) -> Undo:
    """Undo one bias of some of the dwells."""

    def undo(readings: Readings, amplitudes: FloatArray) -> Readings:
        own = side(readings)[:, None]
        return readings.but(outputs=readings.outputs - np.where(own, amplitudes, 0.0))

    return undo


ENTRY = Cause(
    name="hysteresis",
    label="hysteresis",
    doc="The biases differ between heating and cooling, or between tests and checks.",
    hypotheses=_hypotheses,
    apart="one temperature again at the end, reached from the other side",
    rank=50,
    spoils=True,
)
