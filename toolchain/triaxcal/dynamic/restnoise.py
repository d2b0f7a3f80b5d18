"""White noise of both triads from the rests of a recording.

Means over windows of 0.1 s lie beside each other in a rest. Half of the mean squared difference of
neighbours is the Allan variance N^2 / t. A rest with several times that of the others was none; the
others are taken together.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.noise import MICRO_G, DataSheet
from triaxcal.dynamic.survey import Survey
from triaxcal.dynamic.windows import WINDOW_S
from triaxcal.model.types import FloatArray

PAIRS_MIN = 9
"""Differences in a rest that counts."""
EDGE = 3
"""Windows at each end of a rest that do not count."""
NOISIER = 3.0
"""Of the median: a rest of 9 differences in three axes is beyond it once in 20 000, simulated."""


def with_rests(name: str, found: Survey, stated: DataSheet) -> DataSheet:
    """White noise as it is stated, else that of the rests; the counts of those are in it.

    Raises
    ------
    RefusedError
        As `rest_noise`.
    """
    arw, vrw = stated.gyro_arw_deg_per_sqrt_h, stated.accel_vrw_ug_per_sqrt_hz
    if arw is not None and vrw is not None:
        return stated
    rate, force = rest_noise(name, found)
    if arw is None:
        stated = replace(stated, gyro_arw_deg_per_sqrt_h=float(f"{math.degrees(rate) * 60:.3g}"))
    if vrw is None:
        vrw = float(f"{force / MICRO_G:.3g}")
        stated = replace(stated, accel_vrw_ug_per_sqrt_hz=vrw, accel_lsb=0.0)
    return stated


def rest_noise(name: str, found: Survey) -> tuple[float, float]:
    """N of gyros (rad/sqrt(s)) and accelerometers (m/s^2 sqrt(s)), a mean of the three axes.

    With the noise of counting.

    Raises
    ------
    RefusedError
        Where the rests are too short, or show none.
    """
    rests = _rests(found)
    if not rests:
        raise RefusedError(
            f"{name}, rests",
            f"none longer than {(PAIRS_MIN + 1 + 2 * EDGE) * WINDOW_S:g} s: too few for noise",
            expected="longer rests, or [noise] in unit.toml",
            remedy="state the figures of the data sheet in [noise]",
        )
    windows = found.windows
    duration_s = float(np.median(windows.duration_s))
    made = []
    for values, triad in ((windows.rate, "gyros"), (windows.force, "accelerometers")):
        density = math.sqrt(_allan_variance([values[rest] for rest in rests]) * duration_s)
        if density == 0.0:
            raise RefusedError(
                f"{name}, rests",
                f"the {triad} read the same value throughout: their counts are coarser than their "
                "noise",
                expected="noise of a count at least, or [noise] in unit.toml",
                remedy="state the figures of the data sheet in [noise]",
            )
        made.append(density)
    return made[0], made[1]


def _rests(found: Survey) -> list[slice]:
    """Windows of the middle of each rest that is long enough.

    A table that starts or stops is taken for one at rest until the gyros resolve it.
    """
    inner = [slice(rest.first + EDGE, rest.end - EDGE) for rest in found.rests]
    return [part for part in inner if part.stop - part.start > PAIRS_MIN]


def _allan_variance(rests: list[FloatArray]) -> float:
    """Of the windows (n, 3) of each rest, mean of the axes."""
    each = np.array([(np.diff(values, axis=0) ** 2).mean() / 2 for values in rests])
    count = np.array([len(values) - 1 for values in rests])
    quiet = each <= NOISIER * np.median(each)
    return float(np.average(each[quiet], weights=count[quiet]))
