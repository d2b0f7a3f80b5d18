"""Held samples: a log that is faster than the sensor repeats its values.

While a unit moves, the readings of a triad change with every sample of the sensor. A row whose
three readings are those of the row before is then no sample. At rest a coarse sensor repeats itself
by chance; so only rows in motion decide.
"""

from __future__ import annotations

import numpy as np

from triaxcal.model.types import BoolArray, FloatArray

HELD_MIN = 0.05
"""Of the rows in motion: fewer repeats are samples that were lost, and that the logger filled."""
_NEAR = 4
_COUNTS = 25.0
"""Over `2 _NEAR` rows a moving triad changes by so many of its smallest steps: three a row."""
MOVING_MIN = 30
"""Rows in motion that are enough."""


def changed(values: FloatArray) -> BoolArray:
    """Rows (n,) that differ in any column from the row before; the first one does."""
    found = np.ones(len(values), dtype=bool)
    found[1:] = (values[1:] != values[:-1]).any(axis=1)
    return found


def moving(values: FloatArray) -> BoolArray:
    """Rows (n,) in which the readings (n, 3) change by many of their smallest steps."""
    found = np.zeros(len(values), dtype=bool)
    if len(values) <= 2 * _NEAR:
        return found
    steps = np.abs(np.diff(values, axis=0))
    # Of readings without counts the smallest differences are chance: a median says more.
    least = [float(np.quantile(s[s > 0], 0.05)) if (s > 0).any() else np.inf for s in steps.T]
    way = np.abs(values[2 * _NEAR :] - values[: -2 * _NEAR])
    found[_NEAR:-_NEAR] = (way > _COUNTS * np.array(least)).any(axis=1)
    return found


def stuck(values: FloatArray) -> BoolArray:
    """Rows (n,) in motion whose readings (n, 3) are those of the row before."""
    repeats = ~changed(values)
    return repeats & moving(values) if repeats.any() else repeats


def held_share(values: FloatArray) -> float:
    """Part of the rows in motion that repeat the row before; 0 where too few move."""
    where = moving(values)
    if where.sum() < MOVING_MIN:
        return 0.0
    share = 1.0 - float(changed(values)[where].mean())
    return share if share >= HELD_MIN else 0.0
