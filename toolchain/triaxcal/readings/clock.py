"""Times of the rows of a recording: units, dates, several columns, clocks that start again."""

from __future__ import annotations

import datetime
import re
from collections.abc import Sequence

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.types import FloatArray, IntArray
from triaxcal.readings.format import Block
from triaxcal.unit.recordingfile import ISO, TIME_UNITS, ClockLayout

_TIME_OF_DAY = re.compile(r"\d{1,2}:\d\d:\d\d([.,]\d+)?")
_MIDNIGHT = re.compile(r"[T ]00:00:00(\.0+)?$")
"""Of a date in a column of its own: Excel gives dates a time as well."""
_ONE_DIGIT = re.compile(r"[T ](?=\d:)")
_DAY_S = 86400.0
_COUNTERS = (2.0**16, 2.0**32)
_WHOLE = 0.98
"""Of its range: a clock that falls by more than this has started again."""
_HALF = 0.5
"""Of a day: times of day that fall by more than this are of the next day, whatever the pause."""


class Clock:
    """Turns the time columns of blocks, in the order of the file, into seconds.

    Parameters
    ----------
    source, row_word : str
        For messages.
    """

    def __init__(self, layout: ClockLayout, source: str, row_word: str) -> None:
        self._layout, self._source, self._row_word = layout, source, row_word
        self._count = 0
        self._start: datetime.datetime | None = None
        self._first: FloatArray | None = None
        self._last: float | None = None
        self._turns = 0
        self._turn_s = 0.0
        self._of_day = False
        self._largest = 0.0

    @property
    def findings(self) -> tuple[str, ...]:
        """What was repaired."""
        if not self._turns:
            return ()
        name = "midnight" if self._of_day else f"every {self._turn_s:.6g} s"
        times = "once" if self._turns == 1 else f"{self._turns} times"
        return (
            f"the clock starts again {times} ({name}): the times after it continue those before",
        )

    def seconds(self, block: Block, numbers: FloatArray, texts: Sequence[list[str]]) -> FloatArray:
        """Times, shape (n,); NaN where one is missing.

        Parameters
        ----------
        numbers : array, shape (n, columns that are numbers)
        texts : one list a column of dates or times of day

        Raises
        ------
        RefusedError
            At a text that is no time.
        """
        if not self._layout.columns:
            index = self._count + np.arange(len(block.rows))
            self._count += len(block.rows)
            return np.asarray(index / (self._layout.rate_hz or 1.0))
        seconds = self._moments(texts, block.rows) if texts else np.zeros(len(block.rows))
        there = np.isfinite(numbers).all(axis=1) & np.isfinite(seconds)
        if self._first is None and there.any():
            # The first value is taken off before scaling: microseconds of years need all digits.
            self._first = numbers[int(np.argmax(there))] * self._layout.from_first
        scales = [TIME_UNITS[unit] for unit in self._layout.unit_of if unit != ISO]
        for k, scale in enumerate(scales):
            seconds = (
                seconds + (numbers[:, k] - (0.0 if self._first is None else self._first[k])) * scale
            )
        periods: list[float] = []
        if self._of_day and not scales:
            periods = [_DAY_S]
        elif len(scales) == 1 and not texts:
            raw = numbers[there, 0]
            whole = bool((raw == np.rint(raw)).all()) and raw.min(initial=0.0) >= 0.0
            self._largest = max(self._largest, raw.max(initial=0.0)) if whole else np.inf
            periods = [period * scales[0] for period in _COUNTERS if period > self._largest]
        seconds[there] = self._unrolled(seconds[there], periods)
        return seconds

    def _unrolled(self, seconds: FloatArray, periods: Sequence[float]) -> FloatArray:
        """Seconds of a clock that starts again after one of `periods`, going on across it."""
        if not len(seconds):
            return seconds
        step = np.diff(seconds, prepend=seconds[0] if self._last is None else self._last)
        self._last = float(seconds[-1])
        for period in periods:
            back = step < -(_HALF if self._of_day else _WHOLE) * period
            if self._turns == 0 and not back.any():
                continue
            # A late row beside a new start jumps forward by as much and back again.
            turns = self._turns + np.cumsum(back.astype(np.int64) - (step > _WHOLE * period))
            self._turns, self._turn_s = int(turns[-1]), period
            return seconds + turns * period
        return seconds

    def _moments(self, texts: Sequence[list[str]], rows: IntArray) -> FloatArray:
        """Seconds from the first moment, of one column or of a date and a time."""
        seconds = np.full(len(rows), np.nan)
        for k, cells in enumerate(zip(*texts, strict=True)):
            first, *rest = (cell.strip("\"' ") for cell in cells)
            text = "T".join([_MIDNIGHT.sub("", first), *rest]) if rest else first
            if not text.strip("T"):
                continue
            try:
                moment = self._moment(text)
                self._start = self._start or moment
                seconds[k] = (moment - self._start).total_seconds()
            except (ValueError, TypeError) as error:
                raise RefusedError(
                    f"{self._source}, {self._row_word} {rows[k]}",
                    f"found {' '.join(cells)!r}",
                    expected="a date and time, as 2026-03-30T12:00:00.25, or a time of day",
                ) from error
        return seconds

    def _moment(self, text: str) -> datetime.datetime:
        """Moment of ISO 8601, with slashes for dashes, or of a day without a date."""
        if _TIME_OF_DAY.fullmatch(text):
            self._of_day = True
            hours, rest = text.split(":", 1)
            return datetime.datetime.fromisoformat(f"2000-01-01T{hours.zfill(2)}:{rest}")
        return datetime.datetime.fromisoformat(_ONE_DIGIT.sub("T0", text.replace("/", "-")))
