"""The unit sat half a turn round, at some temperatures or at all."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.blocks import apart, at_temperatures, in_blocks, sets_of, unlike
from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Undo, falling
from triaxcal.diagnosis.core.readings import FORCES, POSITIONS, Readings
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    readings = known.readings
    count = len({int(b) for b in readings.block[readings.test]})
    for axis in range(3):
        pairs = _exchanged(axis)
        if count > 1:
            yield Hypothesis(
                f"about {AXES[axis]}",
                _turned(axis, None),
                change=f"it exchanges {pairs}",
                places=6.0,
            )
        if not readings.polarity:
            yield Hypothesis(
                f"about {AXES[axis]}, all sensitivities being negative",
                falling(_turned(axis, None)),
                change=f"it exchanges {pairs}",
                places=6.0,
                log_prior=-2.0,
            )
    for axis, blocks in unlike(readings, range(3), lambda u: u[_ORDERS]):
        if 1 < count == len(blocks):
            continue
        where = at_temperatures(readings, blocks)
        yield Hypothesis(
            f"about {AXES[axis]} {where}",
            _turned(axis, blocks),
            rows=readings.rows[in_blocks(readings, blocks)],
            change=f"it exchanges {_exchanged(axis)} there",
            places=6.0 * sets_of(count),
            log_prior=apart(readings, blocks),
        )


def _signs(axis: int) -> FloatArray:
    return np.where(np.arange(3) == axis, 1.0, -1.0)


def _exchanged(axis: int) -> str:
    """Pairs of positions that a half turn exchanges, in words."""
    names = []
    for k in range(3):
        if k != axis:
            pair = [POSITIONS[int((FORCES[:, k] == s).argmax())] for s in (1.0, -1.0)]
            names.append(" with ".join(sorted(pair)))
    return " and ".join(sorted(names))


_ORDERS = np.array(
    [[int((FORCES @ f).argmax()) for f in FORCES * _signs(axis)] for axis in range(3)]
)
"""Of each half turn and position, the position as which the unit was seated."""


def _turned(axis: int, blocks: tuple[int, ...] | None) -> Undo:
    signs = _signs(axis)

    def undo(readings: Readings, _amplitudes: FloatArray) -> Readings:
        own = readings.test if blocks is None else in_blocks(readings, blocks)
        force = np.where((own & readings.test)[:, None], readings.force * signs, readings.force)
        return readings.but(force=force)

    return undo


ENTRY = Cause(
    name="half_turn",
    label="half a turn of the unit",
    doc="The unit was seated half a turn round: two signs of three are inverted.",
    hypotheses=_hypotheses,
    apart="the sign of each output with a known face upward",
    discrete=True,
    rank=31,
    spoils=True,
)
