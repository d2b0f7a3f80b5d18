"""Positions are exchanged, at some temperatures or at all."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, permutations

import numpy as np

from triaxcal.diagnosis.core.blocks import apart, at_temperatures, in_blocks, sets_of, unlike
from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Undo, falling
from triaxcal.diagnosis.core.readings import FORCES, POSITIONS, Readings
from triaxcal.model.types import FloatArray

Order = tuple[int, ...]
"""Of each position the one under whose name its readings stand."""


def _is_turn(order: Order) -> bool:
    """Whether a turn of the unit does the same."""
    turn = FORCES[list(order)].T @ FORCES / 2.0
    return bool(np.allclose(turn @ turn.T, np.eye(3)) and np.linalg.det(turn) > 0.0)


_ORDERS = tuple(p for p in permutations(range(6)) if not _is_turn(p))
_PAIRS = tuple(combinations(range(6), 2))


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    readings = known.readings
    count = len({int(b) for b in readings.block[readings.test]})
    if count > 1:
        for a, b in _PAIRS:
            yield _throughout(readings, a, b)
    if not readings.polarity:
        for a, b in _PAIRS:
            if (FORCES[a] == -FORCES[b]).all():
                yield _throughout(readings, a, b, negative=True)
    for order, blocks in unlike(readings, _ORDERS, lambda u: u[np.array(_ORDERS)]):
        moved = [k for k in range(6) if order[k] != k]
        every = count > 1 and len(blocks) == count
        if every and len(moved) == 2:
            continue
        where = at_temperatures(readings, blocks)
        names = _in_words(order)
        some = np.isin(readings.positions, [POSITIONS[k] for k in moved])
        one = len(moved) == 2
        ways = len(_PAIRS) if one else len(_ORDERS)
        yield Hypothesis(
            f"{names} {where}",
            _relabelled(order, blocks),
            rows=readings.rows[some & in_blocks(readings, blocks)],
            change=f"with {names} exchanged {where}" if one else f"with them in order {where}",
            places=2.0 * ways * (1.0 if every else sets_of(count)),
            log_prior=apart(readings, blocks),
        )


def _throughout(readings: Readings, a: int, b: int, *, negative: bool = False) -> Hypothesis:
    order = list(range(6))
    order[a], order[b] = b, a
    names = _in_words(tuple(order))
    undo = _relabelled(tuple(order), None)
    return Hypothesis(
        f"{names} at every temperature" + ", all sensitivities being negative" * negative,
        falling(undo) if negative else undo,
        rows=readings.rows[np.isin(readings.positions, [POSITIONS[a], POSITIONS[b]])],
        change=f"with {names} exchanged throughout",
        places=2.0 * len(_PAIRS),
    )


def _in_words(order: Order) -> str:
    """Exchanges as pairs, longer cycles as "TP2 for TP1, TP4 for TP2, TP1 for TP4"."""
    pairs = [k for k in range(6) if order[k] > k and order[order[k]] == k]
    words = [f"{POSITIONS[k]} and {POSITIONS[order[k]]}" for k in pairs]
    words += [f"{POSITIONS[k]} for {POSITIONS[order[k]]}" for k in range(6) if order[order[k]] != k]
    return ", ".join(words)


def _relabelled(order: Order, blocks: tuple[int, ...] | None) -> Undo:
    """Undo an order of the positions in some blocks, or in all."""
    right = {POSITIONS[order[k]]: k for k in range(6)}

    def undo(readings: Readings, _amplitudes: FloatArray) -> Readings:
        own = readings.test if blocks is None else in_blocks(readings, blocks)
        force, names = readings.force.copy(), list(readings.positions)
        for row in np.flatnonzero(own & readings.test):
            k = right[names[row]]
            force[row], names[row] = FORCES[k], POSITIONS[k]
        return readings.but(force=force, positions=tuple(names))

    return undo


ENTRY = Cause(
    name="exchanged",
    label="positions exchanged",
    doc="The readings of two positions or more stand under each other's names.",
    hypotheses=_hypotheses,
    apart="the sign of each output with a known face upward",
    discrete=True,
    rank=30,
    spoils=True,
)
