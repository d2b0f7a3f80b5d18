"""What a log is before it is repaired, and the triads of it that share a clock."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from triaxcal.base.screentext import counted
from triaxcal.dynamic.series import Series
from triaxcal.model.types import FloatArray

NAMES = {"rate": "gyros", "force": "accelerometers", "force2": "second accelerometers"}


@dataclass(frozen=True)
class Log:
    """Rows of a file, of some sensors.

    Attributes
    ----------
    source, row_word : str
        For messages: the file, and what a row of it is called.
    rows : array, shape (n,)
        Numbers of the rows in the file.
    time_s : array, shape (n,)
        In the order of the file.
    columns : mapping of arrays, shapes (n, 3) and (n, 1)
        NaN where a cell is empty.
    rate_hz : float or None
        Of rows without stamps.
    increments : bool
        Whether a triad gives increments.
    """

    source: str
    row_word: str
    rows: FloatArray
    time_s: FloatArray
    columns: Mapping[str, FloatArray]
    rate_hz: float | None = None
    increments: bool = False


@dataclass(frozen=True)
class Part:
    """Triads of one clock, and their columns in its values; `held` where a log repeats them."""

    places: Mapping[str, slice]
    series: Series
    held: bool = False

    @property
    def words(self) -> str:
        """As "gyros and accelerometers"."""
        return " and ".join(NAMES[name] for name in self.places)

    @property
    def rank(self) -> tuple[float, bool]:
        """The clock that counts comes first: the faster one, of two alike that of the gyros."""
        return round(math.log(self.series.step_s), 1), "rate" not in self.places


def hole_words(part: Part) -> list[str]:
    """What was filled, and what was not."""
    series, words = part.series, []
    if series.lost:
        sd = series.step_s * math.sqrt(series.worst)
        unsure = f", the angle over the worst to {math.degrees(sd):.2g} deg"
        unsure *= "rate" in part.places
        words.append(
            f"{counted(series.lost, 'sample')} of the {part.words} lost in "
            f"{counted(series.places, 'place')}, at most "
            f"{1e3 * series.longest_s:.3g} ms: interpolated{unsure}"
        )
    if series.gaps:
        at_s, longest_s = max(series.gaps, key=lambda gap: gap[1])
        words.append(
            f"{counted(len(series.gaps), 'gap')} in the {part.words}, the longest "
            f"{longest_s:.3g} s at {at_s:.6g} s: nothing is taken from one side to the other"
        )
    return words


def between(time_s: FloatArray, values: FloatArray, wanted_s: FloatArray) -> FloatArray:
    """Values of a slow sensor (n,) at other times, linearly."""
    there = np.flatnonzero(np.isfinite(values) & np.isfinite(time_s))
    there = there[np.argsort(time_s[there], kind="stable")]
    if len(there) == 0:
        return np.full(len(wanted_s), np.nan)
    return np.interp(wanted_s, time_s[there], values[there])
