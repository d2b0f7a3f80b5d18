"""The unit sat another way round at some temperatures: a quarter turn, or on another face."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import permutations, product

import numpy as np

from triaxcal.diagnosis.causes.mounting import turned_by
from triaxcal.diagnosis.core.blocks import apart, at_temperatures, in_blocks, sets_of, unlike
from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Undo
from triaxcal.diagnosis.core.readings import FORCES, Readings
from triaxcal.model.types import FloatArray


def _turns() -> list[FloatArray]:
    """Turns of a cube that are no half turns about its axes."""
    found = []
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        turn = np.eye(3)[list(order)] * np.array(signs)[:, None]
        if np.linalg.det(turn) > 0.0 and order != (0, 1, 2):
            found.append(turn)
    return found


_TURNS = _turns()
_ORDERS = np.array([[int((FORCES @ f).argmax()) for f in FORCES @ turn] for turn in _TURNS])
"""Of each turn and position, the position as which the unit was seated."""


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    readings = known.readings
    count = len({int(b) for b in readings.block[readings.test]})
    for k, blocks in unlike(readings, range(len(_TURNS)), lambda u: u[_ORDERS]):
        if len(blocks) == count:
            continue  # the sensor is turned in its case
        yield Hypothesis(
            f"{turned_by(_TURNS[k])} {at_temperatures(readings, blocks)}",
            _seated(_TURNS[k], blocks),
            rows=readings.rows[in_blocks(readings, blocks)],
            change="turned back there",
            places=len(_TURNS) * sets_of(count),
            log_prior=apart(readings, blocks),
        )


def _seated(turn: FloatArray, blocks: tuple[int, ...]) -> Undo:
    def undo(readings: Readings, _amplitudes: FloatArray) -> Readings:
        own = in_blocks(readings, blocks)[:, None]
        return readings.but(force=np.where(own, readings.force @ turn.T, readings.force))

    return undo


ENTRY = Cause(
    name="other_seat",
    label="the unit seated another way round",
    doc="At some temperatures the unit sat a quarter turn round, or on another face.",
    hypotheses=_hypotheses,
    apart="how the unit was seated at these temperatures",
    discrete=True,
    rank=39,
    spoils=True,
)
