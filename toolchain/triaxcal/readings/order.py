"""Rows whose time does not rise: which are left out, and from when on the recording is refused."""

from __future__ import annotations

from bisect import bisect_left
from itertools import islice

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.types import BoolArray, FloatArray

LEFT_OUT_MAX = 0.05
"""Of the rows: the most that may be left out for their times.

A pose is cut where time goes on by more than five steps, which takes five neighbours left out. At
5 % of rows, each for a reason of its own, that is once in 1 / 0.05^5 = 3 million rows; at 10 % it
is once in 100 000, and longer poses would be cut.
"""

AHEAD = 256
"""Rows that wait for those after them: wrong times in a row, at most, that cost no other row."""
_NEAR = 16
_EVENER = 1.1
"""By how much the steps on both sides of a row must be more even than those of an earlier row."""


class _Tally:
    """How many rows, and the number of the first."""

    def __init__(self) -> None:
        self.count = self.first = 0

    def add(self, mask: BoolArray, numbers: FloatArray) -> None:
        if mask.any():
            self.first = self.first or int(numbers[int(np.argmax(mask))])
            self.count += int(mask.sum())

    def __str__(self) -> str:
        return f"{self.count} row{'s' * (self.count != 1)}"


class Order:
    """Sorts out rows whose time does not rise, block after block.

    Parameters
    ----------
    source, row_word, table : str
        For messages; the table of unit.toml.
    """

    def __init__(self, source: str, row_word: str, table: str) -> None:
        self._place, self._word, self._table = f"{source}, {row_word} ", row_word, table
        self._waiting: FloatArray | None = None
        self._before: FloatArray | None = None
        self._newest = -np.inf
        self._count = self._equal = 0
        self._back, self._repeated = _Tally(), _Tally()
        self._largest_s = 0.0

    @property
    def lost(self) -> int:
        """Rows left out, but for those that repeat the row before in everything."""
        return self._back.count + self._repeated.count - self._equal

    def kept(self, rows: FloatArray, *, last: bool) -> FloatArray:
        """Rows to keep of the next ones; column 0 is the time, column 1 the number of the row.

        As many as can be kept with rising times; so `AHEAD` rows wait for the next block, unless
        `last`.
        """
        if self._waiting is not None:
            rows = np.vstack([self._waiting, rows])
        count = len(rows) if last else max(len(rows) - AHEAD, 0)
        self._waiting = rows[count:]
        if not count:
            return rows[:0]
        rise = rising(rows[:, 0], self._newest)
        keep, time_s = rise[:count], rows[:count, 0]
        newest = np.maximum.accumulate(np.append(self._newest, np.where(keep, time_s, -np.inf)))
        later = np.minimum.accumulate(np.where(rise, rows[:, 0], np.inf)[::-1])[::-1][:count]
        step = time_s - newest[:-1]
        repeated = ~keep & (step == 0.0)
        back = ~keep & ~repeated
        self._back.add(back, rows[:, 1])
        self._repeated.add(repeated, rows[:, 1])
        if back.any():
            late = np.where(step > 0.0, np.maximum(time_s - later, 0.0), -step)
            self._largest_s = max(self._largest_s, float(late[back].max()))
        if repeated.any():
            previous = np.vstack([rows[:1] if self._before is None else self._before, rows[:-1]])
            equal = (rows[:count, 2:] == previous[:count, 2:]).all(axis=1)
            self._equal += int(equal[repeated].sum())
        self._count += count
        self._before, self._newest = rows[count - 1 : count], float(newest[count])
        kept: FloatArray = rows[:count][keep]
        return kept

    def findings(self) -> tuple[str, ...]:
        """What was left out, after the last block.

        Raises
        ------
        RefusedError
            When it is more than `LEFT_OUT_MAX` of the rows.
        """
        back, repeated = self._back, self._repeated
        if back.count + repeated.count > LEFT_OUT_MAX * self._count:
            raise self._too_many()
        repeats = (
            f"{repeated} with the time of the row before left out ({self._equal} of them "
            f"identical in all columns), the first is {self._word} {repeated.first}"
        )
        backs = (
            f"{back} out of order in time left out, by at most {self._largest_s:.3g} s, the first "
            f"is {self._word} {back.first}"
        )
        return (repeats,) * bool(repeated.count) + (backs,) * bool(back.count)

    def _too_many(self) -> RefusedError:
        if self._back.count >= self._repeated.count:
            return RefusedError(
                f"{self._place}{self._back.first}",
                f"time runs back by {self._largest_s:.6g} s; {self._back.count} of {self._count} "
                "rows are out of order",
                expected=f"rising time in all but {LEFT_OUT_MAX:.0%} of the rows",
                remedy=f"cut the recording there, or correct the time in [{self._table}]",
            )
        rate = "sample_rate_hz" if self._table != "dynamic" else "rate_hz"
        return RefusedError(
            f"{self._place}{self._repeated.first}",
            f"{self._repeated.count} of {self._count} rows repeat the time of the row before",
            expected="a time of its own for each row",
            remedy="if the clock is coarser than the readings, leave out the time and give "
            f"{rate}; if rows are doubled, remove them",
        )


def rising(time_s: FloatArray, before: float) -> BoolArray:
    """Rows of the longest sequence whose times rise, all later than `before`.

    A row that is later than all before it and earlier than all after it is in every such sequence;
    only the others, with their neighbours, are searched.
    """
    highest = np.maximum.accumulate(np.append(before, time_s[:-1]))
    lowest = np.append(np.minimum.accumulate(time_s[:0:-1])[::-1], np.inf)
    rising = (time_s > highest) & (time_s < lowest)
    searched = ~rising
    searched[1:] |= ~rising[:-1]
    searched[:-1] |= ~rising[1:]
    index = np.flatnonzero(searched & (time_s > before))
    if len(index):
        rising[index] = False
        rising[index[_longest(time_s[index].tolist())]] = True
    return rising


def _longest(times: list[float]) -> list[int]:
    """Indices of the longest rising sequence; of several, one with even steps, then the earlier.

    Schensted's algorithm (Canadian Journal of Mathematics 13, 1961): place n has the times that can
    end a sequence of n, in falling order.
    """
    ends: list[float] = []
    places: list[list[int]] = []
    previous, square = [-1] * len(times), [0.0] * len(times)
    for k, time in enumerate(times):
        place = bisect_left(ends, time)
        if place < len(ends) and ends[place] == time:
            continue
        least = float("inf")
        for j in islice(reversed(places[place - 1] if place else ()), _NEAR):
            if times[j] >= time:
                break
            step = (time - times[j]) ** 2
            if step + square[j] <= _EVENER * least:
                least = min(least, step + square[j])
                previous[k], square[k] = j, step
        if place == len(ends):
            ends.append(time)
            places.append([k])
        else:
            ends[place] = time
            places[place].append(k)
    found = [places[-1][0]]
    while previous[found[-1]] >= 0:
        found.append(previous[found[-1]])
    return found[::-1]
