"""Axes that come in several frames, joined to samples.

A part is what one frame gives: a message, or one case of a multiplexed message. Parts are joined
by equal counters, in whatever order their frames follow one another, or by age: the last frame of
each part before that of the part which makes the sample. What a batch leaves open is kept.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from triaxcal.model.types import IntArray
from triaxcal.rig.bus.frames import BoolArray


@dataclass(frozen=True)
class Part:
    """Columns of one part; arrays of shape (n,).

    Attributes
    ----------
    place : int64 array
        Place of the frame among all since the start, rising.
    sequence, time, status : int64 arrays, or None
        Counter, the unit's clock, status; None where the part has none.
    axes : tuple of arrays
        What is recorded, an array for each axis of the part.
    good : bool array or None
        Which rows have numbers for all of them; None where all have.
    """

    place: IntArray
    t_ns: IntArray
    sequence: IntArray | None
    time: IntArray | None
    status: IntArray | None
    axes: tuple[np.ndarray, ...]
    good: BoolArray | None

    def __len__(self) -> int:
        return len(self.place)

    def take(self, index: IntArray | slice) -> Part:
        """Some of the rows."""
        return self.at(index, self.place[index], self.t_ns[index])

    def at(self, index: IntArray | slice, place: IntArray, t_ns: IntArray) -> Part:
        """Some of the rows under the place and time of the samples that they make."""
        return Part(
            place,
            t_ns,
            None if self.sequence is None else self.sequence[index],
            None if self.time is None else self.time[index],
            None if self.status is None else self.status[index],
            tuple(axis[index] for axis in self.axes),
            None if self.good is None else self.good[index],
        )

    def after(self, before: Part) -> Part:
        """These rows behind those of another batch."""
        if not len(before):
            return self
        good = self.good
        if good is None and before.good is not None:
            good = np.ones(len(self), np.bool_)
        old = before if before.good is not None or good is None else _all_good(before)
        new = Part(self.place, self.t_ns, self.sequence, self.time, self.status, self.axes, good)
        return Part(*(_chained(getattr(old, f.name), getattr(new, f.name)) for f in fields(new)))


def _chained(first: Any, second: Any) -> Any:
    if first is None or second is None:
        return None
    if isinstance(first, tuple):
        return tuple(np.concatenate(pair) for pair in zip(first, second, strict=True))
    return np.concatenate([first, second])


def _all_good(part: Part) -> Part:
    every = np.ones(len(part), np.bool_)
    return Part(part.place, part.t_ns, part.sequence, part.time, part.status, part.axes, every)


@dataclass(frozen=True)
class Joined:
    """Samples put together.

    Attributes
    ----------
    parts : list of Part
        Row i of all parts makes sample i.
    place, t_ns : int64 arrays, shape (n,)
        Of the frame that completes the sample.
    orphans : int64 array
        Places of frames that found no partner.
    """

    parts: list[Part]
    place: IntArray
    t_ns: IntArray
    orphans: IntArray


class CounterJoin:
    """Joins parts whose frames follow one another with equal counters."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._open: list[Part] | None = None

    def feed(self, parts: list[Part]) -> Joined:
        """Samples that these rows complete."""
        if self._open is not None:
            parts = [part.after(rest) for part, rest in zip(parts, self._open, strict=True)]
        count = self._count
        place = np.concatenate([part.place for part in parts])
        order = np.argsort(place, kind="stable")
        owner = np.repeat(np.arange(count), [len(part) for part in parts])[order]
        row = np.concatenate([np.arange(len(part)) for part in parts])[order]
        sequence = np.concatenate([_sequence(part) for part in parts])[order]
        first = self._first(owner, sequence)
        used = np.zeros(len(order), np.bool_)
        for i in range(count):
            used[first + i] = True
        tail = max(len(order) - count + 1, int(first[-1]) + count if len(first) else 0)
        left = np.flatnonzero(~used)
        orphans = place[order[left[left < tail]]]
        open_rows = left[left >= tail]
        self._open = None
        if len(open_rows):
            mine = [open_rows[owner[open_rows] == i] for i in range(count)]
            self._open = [part.take(row[at]) for part, at in zip(parts, mine, strict=True)]
        last = order[first + (count - 1)]
        t_ns = np.concatenate([part.t_ns for part in parts])
        end, end_ns = place[last], t_ns[last]
        found = []
        for i, part in enumerate(parts):
            at = row[_of_owner(owner, first, count, i)]
            found.append(part.at(at, end, end_ns))
        return Joined(found, end, end_ns, orphans)

    def _first(self, owner: IntArray, sequence: IntArray) -> IntArray:
        """Where runs of one frame of each part with equal counters begin; none overlap."""
        count = self._count
        length = len(owner) - count + 1
        if length <= 0:
            return np.zeros(0, np.int64)
        parts = 1 << owner
        seen = parts[:length].copy()
        same = np.ones(length, np.bool_)
        for i in range(1, count):
            same &= sequence[i : i + length] == sequence[:length]
            seen |= parts[i : i + length]
        starts = np.flatnonzero(same & (seen == (1 << count) - 1))
        if len(starts) < 2 or (np.diff(starts) >= count).all():
            return starts
        kept, free = [], 0
        for start in starts.tolist():
            if start >= free:
                kept.append(start)
                free = start + count
        return np.array(kept, np.int64)


def _of_owner(owner: IntArray, first: IntArray, count: int, which: int) -> IntArray:
    """Places of one part's frames in runs of `count` that begin at `first`."""
    if count == 2:
        return np.asarray(first + (owner[first] != which), np.int64)
    members = first[:, None] + np.arange(count)
    return np.asarray(members[owner[members] == which], np.int64)


def _sequence(part: Part) -> IntArray:
    assert part.sequence is not None
    return part.sequence


class AgeJoin:
    """Joins to each row of one part the last of the others, if it is no older than a time.

    Parameters
    ----------
    lead : int
        Place of the part whose frame makes the sample.
    """

    def __init__(self, lead: int, age_s: float) -> None:
        self._lead = lead
        self._age_ns = round(age_s * 1e9)
        self._open: dict[int, Part] = {}

    def feed(self, parts: list[Part]) -> Joined:
        """Samples that these rows complete."""
        lead = parts[self._lead]
        good = np.ones(len(lead), np.bool_)
        rows: dict[int, tuple[Part, IntArray]] = {}
        for i, part in enumerate(parts):
            if i == self._lead:
                continue
            known = part.after(self._open[i]) if i in self._open else part
            at = np.searchsorted(known.place, lead.place, side="right") - 1
            there = at >= 0
            young = np.zeros(len(lead), np.bool_)
            # Without a sign: a clock that was set back must not make an old value young.
            apart_ns = np.abs(lead.t_ns[there] - known.t_ns[at[there]])
            young[there] = apart_ns <= self._age_ns
            good &= young
            rows[i] = known, at
            if len(known):
                self._open[i] = known.take(slice(len(known) - 1, None))
        kept = np.flatnonzero(good)
        rows[self._lead] = lead, np.arange(len(lead))
        found = [rows[i][0].take(rows[i][1][kept]) for i in range(len(parts))]
        return Joined(found, lead.place[kept], lead.t_ns[kept], lead.place[~good])


class NoJoin:
    """Each frame is a sample."""

    def feed(self, parts: list[Part]) -> Joined:
        """Samples of these rows."""
        return Joined(parts, parts[0].place, parts[0].t_ns, parts[0].place[:0])
