"""Rows of a log by the beats of its clock: doubled rows left out, exchanged rows put in order.

For samples that are even, as those of an IMU are. What `order.Order` would leave out is of three
kinds:

exchanged   the stamp falls into a hole of the rising ones: the row belongs there
in its place the stamp is wrong, and the rows before and after leave a beat for it: the row stays,
            with the time of the even clock
left out    neither

Rows that repeat the row before in everything are left out first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.screentext import counted
from triaxcal.model.types import BoolArray, FloatArray, IntArray
from triaxcal.readings.beats import step_of
from triaxcal.readings.evenclock import EvenClock, even_clock
from triaxcal.readings.order import LEFT_OUT_MAX, rising
from triaxcal.readings.packets import packet_clock

_HOLE = 0.7
"""Of a step: so far from both neighbours a stamp has a beat of its own."""
_NEAR_WHOLE = 0.25
"""Of a step: stamps that are nearer to whole steps are not jittered."""
_LATEST = 8
"""Exchanged rows that one more is compared with."""
PLACED_MAX = 0.25
"""Of the rows: where more have no usable stamp, there is no clock."""


@dataclass(frozen=True)
class Sequence:
    """Rows in the order of their beats.

    Attributes
    ----------
    rows : array, shape (m,)
        Indices of the rows of the file.
    clock : EvenClock
        Of these rows.
    findings : tuple of str
    left_out : int
        Rows left out that no other row repeats.
    """

    rows: IntArray
    clock: EvenClock
    findings: tuple[str, ...]
    left_out: int


def sequence(stamps_s: FloatArray, same: BoolArray, numbers: FloatArray, place: str) -> Sequence:
    """Rows of a log in order, numbered by an even clock.

    Parameters
    ----------
    stamps_s : array, shape (n,)
        In the order of the file.
    same : array, shape (n,), bool
        Rows with the readings of the row before.
    numbers : array, shape (n,)
        Of the rows in the file, for messages.
    place : str
        For messages: the file, and what a row of it is called.

    Raises
    ------
    RefusedError
        Where more rows are left out than `LEFT_OUT_MAX`; where more are exchanged or have no usable
        stamp than `PLACED_MAX`.
    """
    found: list[str] = []
    word = place.rsplit(", ", 1)[-1]

    def first(rows: IntArray | BoolArray) -> str:
        return f"the first is {word} {int(numbers[rows][0])}"

    packets = packet_clock(stamps_s, same)
    if packets is not None:
        words = f"{_rows(len(stamps_s))} with stamps of packets: a stamp is that of the newest row"
        return Sequence(np.arange(len(stamps_s)), packets, (words,), 0)
    doubled = same & (np.diff(stamps_s, prepend=np.nan) == 0.0)
    single = np.flatnonzero(~doubled)
    if doubled.any():
        found.append(f"{_rows(int(doubled.sum()))} doubled, left out once, {first(doubled)}")
    step_s = max(step_of(stamps_s[single]), 1e-12)
    kept = rising(stamps_s[single], -np.inf)
    odd, rows = single[~kept], single[kept]
    if _is_clean(stamps_s[rows], step_s):
        # Of jittered stamps it is not known whose place a hole is.
        moved = _exchanged(stamps_s, rows, odd, step_s)
        if len(moved) > PLACED_MAX * len(stamps_s):
            raise _runs_back(f"{place} {int(numbers[moved[0]])}", stamps_s, moved)
        if len(moved):
            rows = np.concatenate([rows, moved])
            rows = rows[np.argsort(stamps_s[rows], kind="stable")]
            odd = odd[~np.isin(odd, moved)]
            found.append(f"{_rows(len(moved))} out of order in time put in order, {first(moved)}")
        placed = _with_room(stamps_s, rows, odd, same, step_s)
    else:
        placed = odd[(odd > rows[0]) & (odd < rows[-1])]
    out = odd[~np.isin(odd, placed)]
    if len(placed) > PLACED_MAX * len(stamps_s):
        raise _no_clock(place, len(placed), len(stamps_s))
    if len(out) > LEFT_OUT_MAX * len(stamps_s):
        raise _runs_back(f"{place} {int(numbers[out[0]])}", stamps_s, out)
    if len(placed):
        found.append(
            f"{_rows(len(placed))} with a stamp that does not fit kept in the place that the rows "
            f"before and after leave, {first(placed)}"
        )
    if len(out):
        found.append(
            f"{_rows(len(out))} with a time that another row has or that runs back left out, "
            f"{first(out)}"
        )
    rows, times = _placed(stamps_s, rows, placed)
    return Sequence(rows, even_clock(times, step_s), tuple(found), len(out))


def _rows(count: int) -> str:
    return counted(count, "row")


def _exchanged(stamps_s: FloatArray, rows: IntArray, odd: IntArray, step_s: float) -> IntArray:
    """Odd rows whose stamps fall into a hole of the others."""
    taken = stamps_s[rows]
    found: list[int] = []
    for k in odd.tolist():
        after = int(np.searchsorted(taken, stamps_s[k]))
        if not 0 < after < len(taken):
            continue
        near = [*taken[after - 1 : after + 1].tolist(), *stamps_s[found[-_LATEST:]].tolist()]
        if min(abs(at - stamps_s[k]) for at in near) > _HOLE * step_s:
            found.append(k)
    return np.array(found, dtype=np.int64)


def _is_clean(stamps_s: FloatArray, step_s: float) -> bool:
    """Whether rising stamps are whole steps apart, but for few."""
    steps = np.diff(stamps_s) / step_s
    return bool(np.mean(np.abs(steps - np.rint(steps)) < _NEAR_WHOLE) > 1 - LEFT_OUT_MAX)


def _with_room(
    stamps_s: FloatArray, rows: IntArray, odd: IntArray, same: BoolArray, step_s: float
) -> IntArray:
    """Odd rows for which the rows before and after in the file leave a beat."""
    by_file = np.sort(rows)
    left: dict[int, int] = {}
    found = []
    for k, after in zip(odd.tolist(), np.searchsorted(by_file, odd).tolist(), strict=True):
        if not 0 < after < len(by_file) or same[k]:
            continue
        way = stamps_s[by_file[after]] - stamps_s[by_file[after - 1]]
        room = left.setdefault(after, round(way / step_s) - 1)
        if room > 0:
            left[after] = room - 1
            found.append(k)
    return np.array(found, dtype=np.int64)


def _placed(stamps_s: FloatArray, rows: IntArray, placed: IntArray) -> tuple[IntArray, FloatArray]:
    """Rows with those that have no usable stamp, and times; theirs lie between their neighbours."""
    if not len(placed):
        return rows, stamps_s[rows]
    # After the row that stands before them in the file, wherever that one was put.
    place = np.argsort(rows, kind="stable")
    before = place[np.searchsorted(rows[place], placed) - 1]
    every = np.concatenate([rows, placed])
    order = np.lexsort((every, np.concatenate([np.arange(len(rows)), before])))
    good = np.concatenate([np.ones(len(rows), dtype=bool), np.zeros(len(placed), dtype=bool)])
    good, every = good[order], every[order]
    index = np.arange(len(every))
    return every, np.interp(index, index[good], stamps_s[every[good]])


def _no_clock(place: str, count: int, of: int) -> RefusedError:
    return RefusedError(
        place,
        f"{count} of {of} rows repeat the time of the row before",
        expected="a time of its own for each row",
        remedy="if the clock is coarser than the readings, leave out the time and give rate_hz",
    )


def _runs_back(place: str, stamps_s: FloatArray, odd: IntArray) -> RefusedError:
    first = int(odd[0])
    back_s = float(stamps_s[: first + 1].max() - stamps_s[first])
    return RefusedError(
        place,
        f"time runs back by {back_s:.6g} s; {len(odd)} of {len(stamps_s)} rows are out of order",
        expected=f"rising time in all but {LEFT_OUT_MAX:.0%} of the rows",
        remedy="cut the recording there, or correct the time in [dynamic]",
    )
