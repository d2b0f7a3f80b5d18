"""Rows of a log by the beats of its clock: doubled rows left out, exchanged rows put in order.

For samples that are even, as those of an IMU are. What `order.Order` would leave out is told apart:

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
from triaxcal.model.types import BoolArray, FloatArray, IntArray
from triaxcal.readings.evenclock import EvenClock, even_clock, step_of
from triaxcal.readings.order import LEFT_OUT_MAX, rising
from triaxcal.readings.packets import packet_clock

_HOLE = 0.7
"""Of a step: so far from both neighbours a stamp has a beat of its own."""
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
        told = (
            f"{_rows(len(stamps_s))} with stamps of packets: the newest row of each has its stamp"
        )
        return Sequence(np.arange(len(stamps_s)), packets, (told,), 0)
    doubled = same & (np.diff(stamps_s, prepend=np.nan) == 0.0)
    single = np.flatnonzero(~doubled)
    if doubled.any():
        found.append(f"{_rows(int(doubled.sum()))} doubled, left out once, {first(doubled)}")
    step_s = max(step_of(stamps_s[single]), 1e-12)
    kept = rising(stamps_s[single], -np.inf)
    odd, rows = single[~kept], single[kept]
    moved = _exchanged(stamps_s, rows, odd, step_s)
    if len(moved) > PLACED_MAX * len(stamps_s):
        raise _runs_back(f"{place} {int(numbers[moved[0]])}", stamps_s, moved)
    if len(moved):
        rows = np.concatenate([rows, moved])
        rows = rows[np.argsort(stamps_s[rows], kind="stable")]
        odd = odd[~np.isin(odd, moved)]
        found.append(f"{_rows(len(moved))} out of order in time put in order, {first(moved)}")
    clock = even_clock(stamps_s[rows], step_s)
    placed, beats = _in_their_place(rows, clock.number, odd, same)
    odd = odd[~np.isin(odd, placed)]
    if len(placed) > PLACED_MAX * len(stamps_s):
        raise _no_clock(place, len(placed), len(stamps_s))
    if len(placed):
        rows, clock = _with(rows, clock, placed, beats)
        found.append(
            f"{_rows(len(placed))} with a stamp that does not fit kept in the place that the rows "
            f"before and after leave, {first(placed)}"
        )
    if len(odd) > LEFT_OUT_MAX * len(stamps_s):
        raise _runs_back(f"{place} {int(numbers[odd[0]])}", stamps_s, odd)
    if len(odd):
        found.append(
            f"{_rows(len(odd))} with a time that another row has or that runs back left out, "
            f"{first(odd)}"
        )
    return Sequence(rows, clock, tuple(found), len(odd))


def _rows(count: int) -> str:
    return f"{count} row{'s' * (count != 1)}"


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


def _in_their_place(
    rows: IntArray, number: IntArray, odd: IntArray, same: BoolArray
) -> tuple[IntArray, IntArray]:
    """Odd rows for which the rows before and after in the file leave a beat, and their beats."""
    by_file = np.argsort(rows)
    rows, number = rows[by_file], number[by_file]
    places = np.searchsorted(rows, odd)
    taken: dict[int, int] = {}
    found, beats = [], []
    for k, after in zip(odd.tolist(), places.tolist(), strict=True):
        if not 0 < after < len(rows) or same[k]:
            continue
        beat = taken.get(after, int(number[after - 1])) + 1
        if beat < number[after]:
            taken[after] = beat
            found.append(k)
            beats.append(beat)
    return np.array(found, dtype=np.int64), np.array(beats, dtype=np.int64)


def _with(
    rows: IntArray, clock: EvenClock, placed: IntArray, beats: IntArray
) -> tuple[IntArray, EvenClock]:
    """Rows and clock with those that have no usable stamp, at the times of their beats."""
    time_s = np.interp(beats, clock.number, clock.time_s)
    number = np.concatenate([clock.number, beats])
    order = np.argsort(number, kind="stable")
    made = EvenClock(
        number[order],
        np.concatenate([clock.time_s, time_s])[order],
        clock.step_s,
        clock.rms_s,
        clock.smoothed,
    )
    return np.concatenate([rows, placed])[order], made


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
