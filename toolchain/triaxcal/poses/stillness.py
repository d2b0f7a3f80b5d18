"""Where a recording is still, without one threshold for all of it.

The *motion* at a moment is by how much the mean reading of the next 0.2 s differs from that of the
last 0.2 s. Noise, tremor and vibration average out of it; turning does not. A stretch is still if
its motion stays below a level, and that level is `CONTRAST` times the rms of its own motion: its
ends move, against what it is itself. So a pose on a table and one in a hand of the same recording
each have a level of their own, and all levels are tried, from the quietest on.

The motion of a stretch is also even, and its sway is small: it is one orientation. A stretch that
was found at a low level grows at a higher one only if it gains as much as a pose is long. So the
first steps of a turn are not taken into a pose.

Cost: a fixed number of passes over the cells.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from triaxcal.model.types import BoolArray, FloatArray, IntArray
from triaxcal.poses.cells import HALF, Cells
from triaxcal.poses.poseset import Stillness
from triaxcal.readings.samples import Samples
from triaxcal.readings.spool import Spool
from triaxcal.readings.table import TIME

SHORTEST_S = 0.5
"""Shorter moments are part of a turn: a hand that reverses stands still as long."""
_FEWEST = 10
"""Samples of a pose: fewer are alike by chance."""
CONTRAST = 2.5
"""Motion about a pose, of the rms motion in it: about the largest of some hundred normal values."""
SPREAD = math.radians(3.0)
"""Sway within a pose, rms: the mean is then too short by 0.14 %, which its uncertainty has."""
_EVEN = 1.5
"""Rms motion of a stretch, of its mean motion; 1.09 for normal noise in three axes."""
_LEVELS = 2.0**0.25
CHUNK = 1 << 18
"""Cells that are searched at once; a chunk ends where it moves most."""
_GUARD = 1
"""Cells left out at either end that borders on motion."""
_SETTLING_S, _SETTLING_SHARE = 0.25, 0.1
"""More left out there, of a stretch that is long enough: a hand lets go, a table calms down."""
_ONE_POSE = math.radians(1.0)
"""Sway, rms, of two neighbours and what lies between: a knock within a pose, and not a turn."""


def find_stillness(
    samples: Samples, shortest_s: float, one_g: float, least_motion: float
) -> Stillness:
    """Still stretches of `shortest_s` and more.

    Parameters
    ----------
    one_g : float
        Reading of 1 g, about.
    least_motion : float
        Motion that readings show in steps without moving, in their unit.
    """
    cells = Cells(samples, shortest_s)
    shown, runs = Spool(2), []
    for first, search in _chunks(cells, least_motion):
        needed = math.ceil(max(shortest_s / samples.step_s, _FEWEST) / cells.size)
        found = search.joined(search.stretches(needed, one_g), needed, one_g)
        settling = math.ceil(_SETTLING_S / (cells.size * samples.step_s))
        trimmed = search.trimmed(found, partial(_guard, needed=needed, settling=settling)) + first
        last = trimmed[:, 1] == len(cells)
        trimmed *= cells.size
        trimmed[last, 1] = len(samples)
        runs += [(start, stop) for start, stop in trimmed.tolist()]
        shown.append(np.column_stack([search.time_s, search.motion[:-1]])[~search.cut[:-1]])
    thinned = shown.thinned() if len(shown) else np.empty((0, 2))
    quietest = float(thinned[:, 1].min()) if len(thinned) else math.inf
    return Stillness(thinned[:, 0], thinned[:, 1], tuple(runs), quietest)


def duration_s(samples: Samples, run: tuple[int, int]) -> float:
    """Length of a run in seconds, each sample standing for a step."""
    start, stop = run
    return samples.one(TIME, stop - 1) - samples.one(TIME, start) + samples.step_s


def _chunks(cells: Cells, least_motion: float) -> Iterator[tuple[int, _Search]]:
    """Index of the first cell, and the search, of each chunk; no pose lies across two of them."""
    first = 0
    while first < len(cells):
        search = _Search(*cells.means(first, first + CHUNK), least_motion)
        count = len(search.time_s)
        if first + count < len(cells):
            half = count // 2
            moves = np.where(search.cut[half:count], np.inf, search.motion[half:count])
            # The last windows are cut by the end of the chunk alone.
            count = half + int(np.argmax(moves[: len(moves) - HALF]))
            search = _Search(*cells.means(first, first + count), least_motion)
        yield first, search
        first += count


def _guard(length: int, needed: int, settling: int) -> int:
    """Cells to leave out at an end of a stretch of some length."""
    free = length - 2 * _GUARD
    return _GUARD + min(settling, int(_SETTLING_SHARE * free), max(free - needed, 0) // 2)


class _Search:
    """Search of still stretches in the means of some cells: runs of edges between them.

    A run of edges [begin, end) has the cells from `HALF` before its first edge to `HALF` behind its
    last one.

    Attributes
    ----------
    time_s : array, shape (n,)
    motion, cut : arrays, shape (n + 1,)
        Of the window about each edge; motion is infinite where the window is cut.
    """

    def __init__(
        self, means: FloatArray, time_s: FloatArray, cut: BoolArray, least_motion: float
    ) -> None:
        self.time_s, self.cut = time_s, cut
        middle = means.mean(axis=0) if len(means) else np.zeros(3)
        self._sums = np.concatenate([np.zeros((1, 3)), np.cumsum(means - middle, axis=0)])
        self._halves = (self._sums[HALF:] - self._sums[:-HALF]) / HALF
        self.motion = np.full(len(cut), np.inf)
        change = np.linalg.norm(self._halves[HALF:] - self._halves[:-HALF], axis=1)
        inner = ~cut[HALF : len(cut) - HALF]
        self.motion[HALF : len(cut) - HALF][inner] = np.hypot(change, least_motion)[inner]
        moved = np.where(cut, 0.0, self.motion)
        self._moved, self._moved_squared = _totals(moved), _totals(moved**2)
        self._half_sums = _totals(self._halves)
        self._half_squares = _totals((self._halves**2).sum(axis=1))

    def stretches(self, needed: int, one_g: float) -> IntArray:
        """Runs of edges, shape (runs, 2), that are still for `needed` cells and more."""
        found = _Found(needed)
        moving = self.motion[~self.cut]
        if not len(moving):
            return found.runs
        level, last = max(float(moving.min()), 1e-9 * one_g), CONTRAST * float(moving.max())
        while level < last * _LEVELS:
            runs = _below(self.motion, level * _LEVELS)
            runs = runs[runs[:, 1] - runs[:, 0] + 2 * HALF - 1 - 2 * _GUARD >= needed]
            still = self._even(runs, level * _LEVELS) & (self._sway(runs) <= SPREAD * one_g)
            found.add(runs[still])
            level *= _LEVELS
        return found.runs

    def joined(self, runs: IntArray, needed: int, one_g: float) -> IntArray:
        """Runs, neighbours of one orientation as one where no turn can lie between them."""
        found: list[tuple[int, int]] = []
        for begin, end in runs.tolist():
            if found and begin - found[-1][1] < needed:
                whole = (found[-1][0], end)
                uncut = not self.cut[found[-1][1] : begin].any()
                if uncut and self._sway(np.array([whole]))[0] <= _ONE_POSE * one_g:
                    found[-1] = whole
                    continue
            found.append((begin, end))
        return np.array(found, dtype=np.int64).reshape(-1, 2)

    def trimmed(self, runs: IntArray, guard: Callable[[int], int]) -> IntArray:
        """Runs of edges as runs of cells, less a guard at the ends that border on motion."""
        found = np.empty_like(runs)
        for k, (begin, end) in enumerate(runs.tolist()):
            start, stop = begin - HALF, end - 1 + HALF
            out = guard(stop - start)
            found[k] = (
                start if self.cut[begin - 1] else start + out,
                stop if self.cut[end] else stop - out,
            )
        return found

    def _even(self, runs: IntArray, level: float) -> BoolArray:
        """Whether the motion is much alike in each run, and below what borders on it."""
        begin, end = runs.T
        mean = (self._moved[end] - self._moved[begin]) / (end - begin)
        square = (self._moved_squared[end] - self._moved_squared[begin]) / (end - begin)
        result: BoolArray = np.sqrt(square) <= np.minimum(_EVEN * mean, level / CONTRAST)
        return result

    def _sway(self, runs: IntArray) -> FloatArray:
        """Rms distance of the means of half windows from their own mean."""
        begin, end = runs[:, 0] - HALF, runs[:, 1]
        count = end - begin
        mean = (self._half_sums[end] - self._half_sums[begin]) / count[:, None]
        squares = (self._half_squares[end] - self._half_squares[begin]) / count
        result: FloatArray = np.sqrt(np.maximum(squares - (mean**2).sum(axis=1), 0.0))
        return result


class _Found:
    """Still stretches of the levels so far, as runs of edges."""

    def __init__(self, needed: int) -> None:
        self.runs: IntArray = np.empty((0, 2), dtype=np.int64)
        self._needed = needed

    def add(self, runs: IntArray) -> None:
        """Take runs of the next level: each holds whole runs of those before, or none."""
        low = np.searchsorted(self.runs[:, 0], runs[:, 0])
        high = np.searchsorted(self.runs[:, 0], runs[:, 1])
        inner = _totals(self.runs[:, 1] - self.runs[:, 0])
        gain = runs[:, 1] - runs[:, 0] - (inner[high] - inner[low])
        taken = (high == low) | (gain >= self._needed)
        replaced = np.zeros(len(self.runs) + 1, dtype=np.int64)
        np.add.at(replaced, low[taken], 1)
        np.add.at(replaced, high[taken], -1)
        kept = np.cumsum(replaced[:-1]) == 0
        found = np.concatenate([self.runs[kept], runs[taken]])
        self.runs = found[np.argsort(found[:, 0], kind="stable")]


def _totals(values: FloatArray | IntArray) -> FloatArray:
    """Running sums from 0, one longer than the values."""
    start = np.zeros((1, *values.shape[1:]))
    return np.concatenate([start, np.cumsum(values, axis=0)])


def _below(motion: FloatArray, level: float) -> IntArray:
    """Runs in which the motion stays below a level, shape (runs, 2), stop excluded."""
    still = np.concatenate([[False], motion < level, [False]])
    edges = np.flatnonzero(still[1:] != still[:-1])
    return edges.reshape(-1, 2)
