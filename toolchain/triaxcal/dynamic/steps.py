"""Blocks of samples into the filter, and between them what is no constant moves."""

from __future__ import annotations

import math
from dataclasses import dataclass

from triaxcal.dynamic.joined import joined_blocks
from triaxcal.dynamic.rootfilter import RootFilter
from triaxcal.dynamic.wander import Wander
from triaxcal.model.types import FloatArray, IntArray


@dataclass
class Steps:
    """A filter and what wanders in it.

    Attributes
    ----------
    filter : RootFilter
    wander : Wander
    moved_s : float
        Up to when its states have moved.
    """

    filter: RootFilter
    wander: Wander
    moved_s: float

    def run(self, rows: FloatArray, freedom: IntArray, ends_s: FloatArray) -> None:
        """Consecutive blocks, of which `ends_s` (blocks + 1,) are the ends.

        States move after each `Wander.step_s`; the blocks in between are one step of the filter.
        """
        if not len(self.wander.columns):
            self.filter.run(rows, freedom)
            return
        block_s = (ends_s[-1] - ends_s[0]) / len(rows)
        size = max(1, min(math.floor(self.wander.step_s / block_s), len(rows)))
        whole = len(rows) // size
        joined, log_root = joined_blocks(rows[: whole * size], size)
        self.filter.log_root += log_root
        measured = freedom[: whole * size].reshape(whole, size).sum(axis=1)
        for k in range(whole):
            self.filter.run(joined[k : k + 1], measured[k : k + 1])
            if ends_s[(k + 1) * size] - self.moved_s > 0.75 * self.wander.step_s:
                self.move(float(ends_s[(k + 1) * size]))
        self.filter.run(rows[whole * size :], freedom[whole * size :])

    def move(self, time_s: float) -> None:
        """Move what is no constant up to a time."""
        if len(self.wander.columns) and time_s > self.moved_s:
            factor, sd = self.wander.over(time_s - self.moved_s)
            self.filter.diffuse(self.wander.columns, sd, factor)
            self.moved_s = time_s
