"""Beats of an even clock that the stamps of rows stand for: how many rows were lost between two.

A beat is missing where the stamps stay late by a whole step, and not where one of them is late.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.ndimage import median_filter

from triaxcal.model.types import FloatArray, IntArray
from triaxcal.readings.phase import beats_by_phase

PAUSE_S = 0.25
"""After a longer pause a clock need not go on with the same beats."""
CLEAN = 0.25
"""Of a step: where all steps are so near to whole ones, rounding numbers them."""
REACH = 8
"""Rows on each side whose median says how late the stamps are there."""
_REACH_MAX = 200
_SURELY = 5.0
"""Deviations of a median at the ends of a log that are a lost row."""
SPAN = 100
"""Rows over which a step is measured: few enough that most spans have lost none."""


def step_of(stamps_s: FloatArray) -> float:
    """Step of most rows in the order of the file, s."""
    span = max(1, min(SPAN, len(stamps_s) // 4))
    about = float(np.median(stamps_s[span:] - stamps_s[:-span])) / span
    steps = np.diff(stamps_s)
    near = np.abs(steps - about) < 0.5 * about
    # Spans hold lost rows, and steps do not; but of strongly jittered stamps they are a selection.
    return float(steps[near].mean()) if near.sum() > 0.9 * len(steps) else about


def consecutive(rows: IntArray) -> list[IntArray]:
    """Rising numbers of rows, cut where they do not follow each other."""
    return np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1) if len(rows) else []


def numbered(stamps_s: FloatArray, step_s: float) -> IntArray:
    """Beats since the first row, shape (n,)."""
    steps = np.diff(stamps_s) / step_s
    whole = np.maximum(np.rint(steps), 1.0)
    pause = steps * step_s > PAUSE_S
    if np.all(np.abs(steps - whole)[~pause] < CLEAN):
        return np.concatenate([[0], np.cumsum(whole)]).astype(np.int64)
    beats = np.where(pause, whole, 1.0)
    edges = [0, *(np.flatnonzero(pause) + 1).tolist(), len(stamps_s)]
    for first, last in pairwise(edges):
        part = stamps_s[first:last]
        by_phase = beats_by_phase(part, step_s)
        if by_phase is None:
            beats[first : last - 1] += _lost_after(part, step_s)
        else:
            beats[first : last - 1] = np.diff(by_phase)
    return np.concatenate([[0], np.cumsum(beats)]).astype(np.int64)


def _lost_after(stamps_s: FloatArray, step_s: float) -> FloatArray:
    """Beats without a row after each row but the last, where the stamps are jittered."""
    count = len(stamps_s)
    lost = np.zeros(max(count - 1, 0))
    if count < 4 * REACH:
        return lost
    late = stamps_s / step_s - np.arange(count)
    low, high = np.quantile(late - median_filter(late, 2 * SPAN + 1, mode="mirror"), [0.16, 0.84])
    sd = (high - low) / 2
    # Medians on both sides are to be known to a tenth of a step; 1.25 sd / sqrt(n) each.
    needed = 2 * (1.25 * sd / 0.1) ** 2
    reach = int(np.clip(needed, REACH, min(_REACH_MAX, count // 4)))
    middle = median_filter(late, 2 * reach + 1, mode="mirror")
    before, after = np.empty((2, count - 1))
    before[reach:], after[: count - 1 - reach] = middle[: -reach - 1], middle[reach + 1 :]
    limit = np.full(count - 1, 0.5)
    for k in range(reach):  # at the ends there are fewer rows, and they have to say more
        before[k], after[count - 2 - k] = np.median(late[: k + 1]), np.median(late[count - 1 - k :])
        limit[[k, count - 2 - k]] = max(0.5, _SURELY * 1.25 * sd / np.sqrt(k + 1))
    stays = np.flatnonzero(after - before > limit)
    steps = np.diff(stamps_s) / step_s - 1.0
    for run in consecutive(stays):
        beats = int(np.rint(after[run[-1]] - before[run[0]]))
        for _ in range(beats):
            # One after the other at the longest step that is left: several may be lost close by.
            worst = run[int(np.argmax(steps[run] - lost[run]))]
            lost[worst] += 1.0
    return lost
