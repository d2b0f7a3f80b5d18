"""Where a gyro met its full scale for a moment: the attitude is lost there, and only there.

A gyro that clips reads its full scale many times, and the next smaller value seldom; noise in an
even turn does the reverse. Counts that are coarser than the noise do not: of a table that turns at
1000.9 counts a sample they read 1001 nine times of ten. But they read 1000 in between. Larger
values may be there, where a log was mended. The turn of that moment is unknown, so that the
recording is cut: what follows begins with the next rest.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from triaxcal.dynamic.windows import Windows
from triaxcal.model.types import BoolArray, FloatArray, IntArray

SAME = 1e-4
"""Full scales of both signs differ by one count."""
SAMPLES, TIMES = 5, 3
"""At full scale: at least so many, and so many times those at the next smaller value or above."""
NEAR, DIPS = 1e-3, 0.1
"""Counts and noise of an even turn are within this part of its rate, and lower readings are in more
than this part of its windows."""
LEAST_RAD_PER_S = np.radians(50.0)
"""No full scale of a gyro for motion is smaller."""


def clipped(windows: Windows) -> BoolArray:
    """Windows, shape (w,), in which a gyro stays at its full scale."""
    found = np.zeros(len(windows.first), dtype=bool)
    for axis in range(3):
        peak, count = windows.rate_peak[:, axis], windows.at_peak[:, axis]
        held = (count > 1) & (peak > LEAST_RAD_PER_S)
        if not held.any():
            continue
        values, place = np.unique(peak[held], return_inverse=True)
        scale = float(values[np.argmax(np.bincount(place, weights=count[held]))])
        at_scale = np.abs(peak - scale) <= SAME * scale
        near = (1 - NEAR) * scale
        below = (peak >= near) & (peak < (1 - SAME) * scale)
        following = at_scale & (windows.rate_next[:, axis] >= near)
        less = np.r_[peak[below], windows.rate_next[following, axis]]
        times = np.r_[count[below], windows.at_next[following, axis]]
        others = _most(less, times), int(count[peak > (1 + SAME) * scale].sum())
        many = count[peak == scale].sum() >= max(SAMPLES, TIMES * max(others))
        low = windows.rate_low[:, axis]
        if many and not _even(at_scale, low >= near, low < peak, windows.section):
            found |= peak >= (1 - SAME) * scale
    return found


def _most(values: FloatArray, times: IntArray) -> int:
    """How often the most frequent of the values was read; 0 of none."""
    place = np.unique(values, return_inverse=True)[1]
    return int(np.bincount(place, weights=times).max(initial=0.0))


def _even(at_scale: BoolArray, close: BoolArray, below: BoolArray, section: IntArray) -> bool:
    """Whether the rate only dips a little between windows at scale.

    `close` are windows all of whose readings are close to it, `below` those that have smaller ones.
    A clip begins and ends on slopes; between them the gyro reads nothing but its full scale, or far
    less where a hand shakes.
    """
    inner = np.zeros(len(at_scale), dtype=bool)
    inner[1:-1] = at_scale[:-2] & at_scale[1:-1] & at_scale[2:] & (section[:-2] == section[2:])
    return bool((inner & close & below).sum() > DIPS * inner.sum())


def cut_at_clips(
    windows: Windows, edges: list[tuple[int, int]]
) -> tuple[Windows, list[tuple[int, int]], tuple[str, ...]]:
    """The same with a section more after each moment in which a gyro clips, and words for it.

    Edges are the numbers of the first and last sample of each section.
    """
    lost = clipped(windows)
    starts = np.flatnonzero(lost & ~np.r_[False, lost[:-1]])
    if len(starts) == 0:
        return windows, edges, ()
    section = windows.section + np.cumsum(lost & ~np.r_[False, lost[:-1]])
    new = []
    for number in np.unique(section):
        inside = np.flatnonzero(section == number)
        last = edges[int(windows.section[inside[0]])][1]
        after = inside[-1] + 1
        if after < len(section) and windows.section[after] == windows.section[inside[0]]:
            last = int(windows.first[after]) - 1
        new.append((int(windows.first[inside[0]]), last))
    at = ", ".join(f"{windows.start_s[k]:.1f}" for k in starts[:5])
    more = f" and {len(starts) - 5} more" if len(starts) > 5 else ""
    said = f"a gyro clips at {at}{more} s: not used from there to the next rest"
    renumbered = np.unique(section, return_inverse=True)[1].astype(np.int64)
    return replace(windows, section=renumbered), new, (said,)
