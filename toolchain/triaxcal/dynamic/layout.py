"""Which states there are and where they stand in the vector of constants."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from triaxcal.dynamic.blocks.block import Signals, State, StateBlock
from triaxcal.model.types import FloatArray, IntArray


@dataclass(frozen=True)
class Layout:
    """The constants p of the blocks that are switched on, one block after the other.

    A block that two extensions bring is there once.
    """

    blocks: tuple[StateBlock, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "blocks", tuple(dict.fromkeys(self.blocks)))

    @property
    def states(self) -> tuple[State, ...]:
        """Every state of p, in its order."""
        return tuple(state for block in self.blocks for state in block.states)

    def __len__(self) -> int:
        return len(self.states)

    def __contains__(self, name: str) -> bool:
        return any(block.name == name for block in self.blocks)

    def place(self, name: str) -> slice:
        """Where the states of a block stand."""
        start = 0
        for block in self.blocks:
            if block.name == name:
                return slice(start, start + len(block.states))
            start += len(block.states)
        raise KeyError(name)

    def part(self, p: FloatArray, name: str) -> FloatArray:
        """States of a block, SI; zeros where it is not switched on."""
        return p[self.place(name)] if name in self else np.zeros(9)

    @property
    def per_unit(self) -> FloatArray:
        """SI value of the unit of each state."""
        return np.array([state.per_unit for state in self.states])

    @property
    def prior_sd(self) -> FloatArray:
        """Standard deviations before the recording, SI."""
        return np.array([state.prior_sd * state.per_unit for state in self.states])

    def columns(self, kind: str) -> list[tuple[StateBlock, slice]]:
        """Blocks that have rows of a kind ("rate", "force", ...), with their places."""
        return [(b, self.place(b.name)) for b in self.blocks if getattr(b, kind) is not None]

    def reset_columns(self) -> IntArray:
        """Places of the states that are new at each mounting."""
        found = [np.arange(len(self))[self.place(b.name)] for b in self.blocks if b.reset]
        return np.concatenate([*found, np.empty(0, dtype=np.int64)]).astype(np.int64)

    def rows(self, kind: str, signals: Signals) -> FloatArray:
        """Rows of a kind for all constants, shape (points, 3, n); zero where a block has none."""
        result = np.zeros((len(signals.rate), 3, len(self)))
        for block, place in self.columns(kind):
            make: Callable[[Signals], FloatArray] = getattr(block, kind)
            result[:, :, place] = make(signals)
        return result
