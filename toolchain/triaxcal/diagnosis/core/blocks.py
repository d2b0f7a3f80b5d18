"""Blocks of test dwells that are unlike the others, and what makes them alike again.

Another label, sign, column or gain moves outputs by tens of percent; temperature moves them by a
few. So what was done to a block shows in its six readings alone: of all changes of a kind the one
that brings them nearest those of the other blocks. The causes propose what is found here, and it
competes by its evidence.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

import numpy as np

from triaxcal.diagnosis.core.cause import Hypothesis, Undo
from triaxcal.diagnosis.core.readings import FORCES, Readings
from triaxcal.model.types import BoolArray, FloatArray

Changed = Callable[[FloatArray], FloatArray]
"""Outputs of a block by POSITIONS, shape (6, 3) -> after each change of a kind, (n, 6, 3)."""
Key = TypeVar("Key")
Blocks = tuple[int, ...]
Struck = tuple[Undo, str, str]
"""How a change is undone, its text, and what it would change."""
_APART = -3.0
"""Log probability that a mistake strikes at blocks that do not follow each other."""


def unlike(
    readings: Readings, changes: Sequence[Key], changed: Changed
) -> Iterator[tuple[Key, tuple[int, ...]]]:
    """Changes, and the blocks that each makes like the others, or like those of an ideal unit.

    `changed` gives outputs after each of the `changes`. All blocks alike are a set as well.
    """
    outputs = readings.test_blocks
    if not outputs:
        return
    seen = set()
    for reference in (np.median(list(outputs.values()), axis=0), FORCES):
        found: dict[int, list[int]] = defaultdict(list)
        for block, own in outputs.items():
            distances = ((changed(own) - reference) ** 2).sum(axis=(1, 2))
            best = int(distances.argmin())
            if distances[best] < ((own - reference) ** 2).sum():
                found[best].append(block)
        for best, blocks in found.items():
            if (best, *blocks) not in seen:
                seen.add((best, *blocks))
                yield changes[best], tuple(blocks)


def struck_some(
    readings: Readings, changes: Sequence[Key], changed: Changed, described: Callable[..., Struck]
) -> Iterator[Hypothesis]:
    """Hypotheses that one of some changes struck at some blocks; at all it is another cause.

    `described` gives for a change, its blocks and their place in words: how the change is undone,
    the text, and what it would change.
    """
    count = len(readings.test_blocks)
    for key, blocks in unlike(readings, changes, changed):
        if len(blocks) == count:
            continue
        undo, text, change = described(key, blocks, at_temperatures(readings, blocks))
        yield Hypothesis(
            text,
            undo,
            rows=readings.rows[in_blocks(readings, blocks)],
            change=change,
            places=len(changes) * sets_of(count),
            log_prior=apart(readings, blocks),
        )


def in_blocks(readings: Readings, blocks: tuple[int, ...]) -> BoolArray:
    """Mask of the dwells of some blocks."""
    return np.asarray((readings.block[:, None] == blocks).any(axis=1))


def sets_of(count: int) -> float:
    """How many sets of blocks there are that follow each other."""
    return count * (count + 1) / 2.0


def apart(readings: Readings, blocks: tuple[int, ...]) -> float:
    """Log probability of a set of blocks, against one of blocks that follow each other.

    They may do so in the order of the file or in that of the temperatures.
    """
    tests = list(readings.test_blocks)
    by_temp = sorted(tests, key=readings.block_degc)
    return _APART * (min(_runs(order, blocks) for order in (tests, by_temp)) - 1)


def _runs(order: list[int], blocks: tuple[int, ...]) -> int:
    inside = np.isin(order, blocks).astype(int)
    return max(1, int((np.diff(inside, prepend=0) > 0).sum()))


def at_temperatures(readings: Readings, blocks: tuple[int, ...]) -> str:
    """The place of a set of blocks in words: "at -40 and 20 degC", "at every temperature"."""
    if len(blocks) > 1 and len(blocks) == len(readings.test_blocks):
        return "at every temperature"
    temps = [f"{t:.4g}" for t in sorted(readings.block_degc(b) for b in blocks)]
    listed = temps[0] if len(temps) == 1 else f"{', '.join(temps[:-1])} and {temps[-1]}"
    return f"at {listed} degC"
