"""Rows whose time does not rise: which are left out, and from when on the recording is refused."""

from __future__ import annotations

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.types import BoolArray, FloatArray

LEFT_OUT_MAX = 0.05
"""Of the rows: the most that may be left out for their times.

A pose is cut where time goes on by more than five steps, which takes five neighbours left out. At
5 % of rows, each for a reason of its own, that is once in 1 / 0.05^5 = 3 million rows; at 10 % it
is once in 100 000, and longer poses would be cut.
"""


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

        A row is left out that is not later than all before it; but where the next two rows are
        earlier than one, that one is wrong. So two rows wait for the next block, unless `last`.
        """
        if self._waiting is not None:
            rows = np.vstack([self._waiting, rows])
        count = len(rows) if last else max(len(rows) - 2, 0)
        self._waiting = rows[count:]
        if not count:
            return rows[:0]
        time_s = rows[:, 0]
        wrong = np.zeros(len(rows), dtype=np.bool_)
        earlier = np.append(self._newest, time_s[:-1])
        wrong[:-2] = (time_s[:-2] > np.maximum(time_s[1:-1], time_s[2:])) & (
            time_s[1:-1] > earlier[:-2]
        )
        newest = np.maximum.accumulate(np.append(self._newest, np.where(wrong, -np.inf, time_s)))
        step = (time_s - newest[:-1])[:count]
        back, repeated = (step < 0.0) | wrong[:count], step == 0.0
        self._back.add(back, rows[:, 1])
        self._repeated.add(repeated, rows[:, 1])
        if back.any():
            late = np.where(wrong[:count], time_s[:count] - np.append(time_s[1:], 0)[:count], -step)
            self._largest_s = max(self._largest_s, float(late[back].max()))
        if repeated.any():
            previous = np.vstack([rows[:1] if self._before is None else self._before, rows[:-1]])
            equal = (rows[:count, 2:] == previous[:count, 2:]).all(axis=1)
            self._equal += int(equal[repeated].sum())
        self._count += count
        self._before, self._newest = rows[count - 1 : count], float(newest[count])
        kept: FloatArray = rows[:count][~(back | repeated)]
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
        rate = "sample_rate_hz" if self._table == "recording" else "rate_hz"
        return RefusedError(
            f"{self._place}{self._repeated.first}",
            f"{self._repeated.count} of {self._count} rows repeat the time of the row before",
            expected="a time of its own for each row",
            remedy="if the clock is coarser than the readings, leave out the time and give "
            f"{rate}; if rows are doubled, remove them",
        )
