"""Two positions are exchanged, at one temperature or at all."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Undo, falling
from triaxcal.diagnosis.core.readings import FORCES, POSITIONS, Readings
from triaxcal.model.types import BoolArray, FloatArray


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    readings = known.readings
    blocks = [b for b in readings.blocks if readings.test[readings.of_block(b)].any()]
    pairs = list(combinations(range(6), 2))
    for a, b in pairs:
        names = f"{POSITIONS[a]} and {POSITIONS[b]}"
        two = np.isin(readings.positions, [POSITIONS[a], POSITIONS[b]])
        if len(blocks) > 1:
            yield Hypothesis(
                f"{names} at every temperature",
                _relabelled(a, b, None),
                rows=readings.rows[two],
                change=f"with {names} exchanged throughout",
                places=2.0 * len(pairs),
            )
        if not readings.polarity and (FORCES[a] == -FORCES[b]).all():
            yield Hypothesis(
                f"{names} at every temperature, all sensitivities being negative",
                falling(_relabelled(a, b, None)),
                rows=readings.rows[two],
                change=f"with {names} exchanged throughout",
                places=2.0 * len(pairs),
            )
        for block in blocks:
            own = two & readings.of_block(block)
            if own.sum() == 2:
                degc = readings.block_degc(block)
                yield Hypothesis(
                    f"{names} at {degc:.4g} degC",
                    _relabelled(a, b, block),
                    rows=readings.rows[own],
                    change=f"with {names} exchanged at {degc:.4g} degC",
                    places=2.0 * len(pairs) * len(blocks),
                )


def _relabelled(a: int, b: int, block: int | None) -> Undo:
    def undo(readings: Readings, _amplitudes: FloatArray) -> Readings:
        own: BoolArray = np.ones(len(readings), dtype=np.bool_)
        if block is not None:
            own = readings.of_block(block)
        names = np.array(readings.positions)
        force = readings.force.copy()
        force[own & (names == POSITIONS[a])] = FORCES[b]
        force[own & (names == POSITIONS[b])] = FORCES[a]
        changed = [
            POSITIONS[{a: b, b: a}.get(POSITIONS.index(p), POSITIONS.index(p))]
            if o and p in POSITIONS
            else p
            for p, o in zip(readings.positions, own, strict=True)
        ]
        return readings.but(force=force, positions=tuple(changed))

    return undo


ENTRY = Cause(
    name="exchanged",
    label="two positions exchanged",
    doc="The readings of two positions stand under each other's names.",
    hypotheses=_hypotheses,
    apart="the sign of each output with a known face upward",
    discrete=True,
    rank=30,
    spoils=True,
)
