"""The unit sat half a turn round, at one temperature or at all."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Undo, falling
from triaxcal.diagnosis.core.readings import FORCES, POSITIONS, Readings
from triaxcal.model.positions import AXES
from triaxcal.model.types import BoolArray, FloatArray


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    readings = known.readings
    blocks = [b for b in readings.blocks if readings.test[readings.of_block(b)].any()]
    for axis in range(3):
        pairs = _exchanged(axis)
        if len(blocks) > 1:
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
        for block in blocks:
            degc = readings.block_degc(block)
            yield Hypothesis(
                f"about {AXES[axis]} at {degc:.4g} degC",
                _turned(axis, block),
                rows=readings.rows[readings.of_block(block)],
                change=f"it exchanges {pairs} there",
                places=6.0 * len(blocks),
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


def _turned(axis: int, block: int | None) -> Undo:
    signs = _signs(axis)

    def undo(readings: Readings, _amplitudes: FloatArray) -> Readings:
        own: BoolArray = np.ones(len(readings), dtype=np.bool_)
        if block is not None:
            own = readings.of_block(block)
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
