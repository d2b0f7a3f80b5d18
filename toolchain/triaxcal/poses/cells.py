"""Means of a recording over cells of 0.05 s: all that the search for stillness reads."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.model.types import BoolArray, FloatArray
from triaxcal.readings.samples import READING, Samples
from triaxcal.readings.spool import Spool
from triaxcal.readings.table import GAP, LABEL, TIME

HALF = 4
"""Cells of half a window: means over it are compared with those over the next."""
HALF_S = 0.2
"""Two periods of a hand's tremor of 10 Hz, which so averages out."""
_SHARE = 0.4
"""Of the shortest pose: half a window is no longer."""
_MEAN, _TIME, _BEFORE, _INSIDE = slice(0, 3), 3, 4, 5


class Cells:
    """Means of equal numbers of consecutive samples; a rest at the end is left out.

    Attributes
    ----------
    size : int
        Samples of a cell.
    spool : Spool
        Means of x, y, z; time of the first sample in s; whether a gap or a change of section lies
        before that sample; how many lie behind it within the cell.
    """

    def __init__(self, samples: Samples, shortest_s: float) -> None:
        half_s = min(HALF_S, _SHARE * shortest_s)
        self.size = max(1, round(half_s / HALF / samples.step_s))
        self.spool = Spool(6)
        waiting = np.empty((0, 5))
        for rows in _with_cuts(samples):
            waiting = np.concatenate([waiting, rows])
            whole = len(waiting) // self.size
            blocks = waiting[: whole * self.size].reshape(whole, self.size, 5)
            waiting = waiting[whole * self.size :]
            time_s, cuts = blocks[:, 0, 3], blocks[:, :, 4]
            means = blocks[:, :, _MEAN].mean(axis=1)
            self.spool.append(np.column_stack([means, time_s, cuts[:, 0], cuts[:, 1:].sum(axis=1)]))

    def __len__(self) -> int:
        return len(self.spool)

    def means(self, start: int, stop: int) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Means of cells, (n, 3), their times, (n,), and whether a window is cut, (n + 1,).

        Window k has `HALF` cells on either side of the edge before cell k; where they are not all
        there, or not of one stretch, it is cut.
        """
        rows = self.spool.rows(start, stop)
        n = len(rows)
        before = np.concatenate([[0.0], np.cumsum(rows[:, _BEFORE])])
        inside = np.concatenate([[0.0], np.cumsum(rows[:, _INSIDE])])
        cut = np.ones(n + 1, dtype=np.bool_)
        edge = np.arange(HALF, n - HALF + 1)
        if len(edge):
            low, high = edge - HALF, edge + HALF
            cut[edge] = before[high] - before[low + 1] + inside[high] - inside[low] > 0.0
        return np.ascontiguousarray(rows[:, _MEAN]), rows[:, _TIME].copy(), cut


def _with_cuts(samples: Samples) -> Iterator[FloatArray]:
    """Readings, time, and as 1 whether a gap in time or another section ends there, (n, 5) each."""
    before_s, before_label = 0.0, None
    for _, rows in samples.pieces():
        time_s = samples.cut(rows, TIME)
        cuts = np.diff(time_s, prepend=before_s) > GAP * samples.step_s
        before_s = float(time_s[-1])
        if LABEL in samples:
            labels = samples.cut(rows, LABEL)
            cuts |= (
                np.diff(labels, prepend=labels[0] if before_label is None else before_label) != 0
            )
            before_label = float(labels[-1])
        yield np.column_stack([samples.cut(rows, READING), time_s, cuts])
