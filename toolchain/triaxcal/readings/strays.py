"""Stray rows: readings that do not belong between those before and after.

A sensor that passes nothing above half of its sampling rate cannot read one far-off value between
smooth ones. Such a row is a transmission error, a zero of a driver that had no sample, or a number
of another kind, as an increment among instants. A knock is none: the rows beside it are rough too.
"""

from __future__ import annotations

import numpy as np

from triaxcal.model.types import BoolArray, FloatArray

STRAYS_MAX = 0.01
"""Of the rows: more are no errors of transmission."""
_NOISE = 20.0
"""Times the median of what rows miss the cubic through their neighbours by."""
_ROUGH = 10.0
"""Times what the rows before and after miss, without the row between them."""
_COUNTS = 20.0
"""Times the smallest step of the readings, where rounding hides the noise."""
_LEAST = 100
_SIZE, _LARGE = 0.05, 0.99
"""Of the readings that only one of a hundred exceeds: knocks on a table miss by less."""


def strays(values: FloatArray) -> BoolArray:
    """Rows (n,) of a triad (n, 3) that do not fit between their neighbours."""
    found = np.zeros(len(values), dtype=bool)
    if len(values) < _LEAST:
        return found
    x = values
    here = x[3:-3]
    miss = np.abs(here - (4 * (x[2:-4] + x[4:-2]) - x[1:-5] - x[5:-1]) / 6)
    # Without the row: cubics through two rows before it and two after it, at distances of
    # -3 -2 | -1 | 1 2 and -2 -1 | 1 | 2 3.
    before = np.abs(x[2:-4] + 0.3 * x[:-6] - x[1:-5] - 0.5 * x[4:-2] + 0.2 * x[5:-1])
    after = np.abs(x[4:-2] + 0.2 * x[1:-5] - 0.5 * x[2:-4] - x[5:-1] + 0.3 * x[6:])
    rough = np.maximum(before, after)
    steps = np.abs(np.diff(x, axis=0))
    least = np.array([s[s > 0].min() if (s > 0).any() else 0.0 for s in steps.T])
    limit = np.maximum(_NOISE * np.median(miss, axis=0), _COUNTS * least)
    limit = np.maximum(limit, _SIZE * float(np.quantile(np.abs(x), _LARGE)))
    found[3:-3] = ((miss > limit) & (miss > _ROUGH * rough)).any(axis=1)
    return found


def part_of(values: FloatArray, rows: BoolArray) -> float:
    """Which part of what their neighbours expect these rows (n,) of a triad (n, 3) read."""
    at = np.flatnonzero(rows)
    expected = (values[at - 1] + values[at + 1]) / 2
    return float(np.median((values[at] * expected).sum(axis=1) / (expected**2).sum(axis=1)))
