"""Samples out of frames: checked, joined, numbered, so that every loss is counted.

Which frames and signals they are is the rig description's matter alone
(`triaxcal.rig.description` has the seam). The samples do not depend on how the frames were cut
into batches.

A sample's number grows by the counter's step. The counter alone misses the loss of a whole turn
(256 samples of the tilter's classic frames), so the turns are taken from the time of arrival, and
the unit's own clock must then agree, or the sample is marked as a jump (`numbering`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from triaxcal.model.types import IntArray
from triaxcal.rig.bus.frames import BoolArray, Frames
from triaxcal.rig.description.description import MessageUse, RigDescription
from triaxcal.rig.description.recorded import Recorded, SignalUnit
from triaxcal.rig.description.rows import Rows, available, rows_of, status_of
from triaxcal.rig.plan.nominal import AS_SENT, Coding
from triaxcal.rig.samples.framecounters import FrameCounters
from triaxcal.rig.samples.join import AgeJoin, CounterJoin, Joined, NoJoin, Part
from triaxcal.rig.samples.numbering import Clocks, Numbering
from triaxcal.rig.samples.onechannel import OneChannel
from triaxcal.rig.samples.parts import (
    PartPlan,
    codes_of,
    first_of,
    lacking,
    parts_of,
    status_of_parts,
)
from triaxcal.rig.samples.rates import RateWatch


@dataclass(frozen=True)
class Samples:
    """Samples in the order of their arrival.

    Attributes
    ----------
    number : int64 array, shape (n,)
        0, 1, 2, ... since the first; a number left out is a lost sample.
    t_ns : int64 array, shape (n,)
        Time of arrival.
    codes : int64 or float64 array, shape (n, 3)
        What is recorded, axis order x, y, z: raw integers, or values in codes of unit.toml.
    gyros : array, shape (n, 3) or (n, 0)
        The same of the gyros; values are physical ones.
    status : int64 array, shape (n,)
        Bits in which the status differs from a good one.
    jump : bool array, shape (n,)
        Counter and the unit's time do not fit the sample before.
    temp_number, temp_code : arrays, shape (m,)
        Codes of the thermometer, each with the number of the sample before it.
    serials, rates : sets of int
        What the rig said of itself: serial number as it is sent, rate in Hz.
    trouble_number, trouble : int64 arrays, shape (k,)
        What went wrong, by the constants below or an error frame's ID with its flag, each with
        the number of the sample before it (-1: before the first).
    """

    number: IntArray
    t_ns: IntArray
    codes: np.ndarray
    status: IntArray
    jump: BoolArray
    gyros: np.ndarray
    temp_number: IntArray
    temp_code: np.ndarray
    serials: frozenset[int]
    rates: frozenset[int]
    trouble_number: IntArray
    trouble: IntArray


BAD_CRC, ORPHAN, DUPLICATE, INVALID, LOST_FRAME, CONFLICT = 1, 2, 3, 4, 5, 6
"""A frame with a wrong CRC, length or kind; one without its partner; a sample sent twice; a value
that is no number or not available; a frame lost of a message whose counter numbers no samples; an
equal counter with other values, as two nodes under one ID send."""


class SampleDecoder:
    """Turns frames of one unit into samples, remembering what a batch leaves open.

    Parameters
    ----------
    rate_hz : int
        Samples a second.
    coding : Coding
        How values become codes of unit.toml; by default they stay values.
    """

    def __init__(self, rig: RigDescription, rate_hz: int, coding: Coding = AS_SENT) -> None:
        self._rig = rig
        self._coding = coding
        self._parts = parts_of(rig)
        self._seen = 0
        self._channel = OneChannel(rig)
        lead = self._lead
        numbers = self._parts[lead].use.counter is not None and (
            rig.join == "counter"
            or not (self._parts[lead].conditions or self._parts[lead].use.only)
        )
        self._counted = (
            {p.use.name for p in self._parts if rig.join == "counter"}
            or ({self._parts[lead].use.name} if numbers else set())
        )  # fmt: skip
        self._join: CounterJoin | AgeJoin | NoJoin = NoJoin()
        self._rates: RateWatch | None = None
        if rig.join == "counter":
            self._join = CounterJoin(len(self._parts))
        elif rig.join:
            self._join = AgeJoin(lead, rig.age_s)
            self._rates = RateWatch(rig, self._parts, lead, rate_hz)
        clock = rig.sample_time
        self._numbering = Numbering(
            Clocks(
                rate_hz,
                self._parts[lead].use.turn if numbers else 0,
                clock.turn if clock else 0,
                clock.tick_us if clock else 1.0,
            )
        )
        self._counters = FrameCounters(rig, self._counted)

    @property
    def _lead(self) -> int:
        """Part whose frame makes the sample."""
        here = [i for i, p in enumerate(self._parts) if p.use.name == self._rig.sample_at]
        return next((i for i in here if 2 in self._parts[i].axes), here[-1])

    def feed(self, frames: Frames) -> Samples:
        """Samples that these frames complete.

        Raises
        ------
        RefusedError
            When a message of the rig comes on several channels at once; when an axis that is
            joined by age comes in a slower message than the sample.
        """
        rig, seen = self._rig, self._seen
        self._channel.watch(frames)
        self._seen += len(frames)
        found = {name: rows_of(use, frames, seen) for name, use in rig.messages.items()}
        rows = {name: good for name, (good, _) in found.items()}
        parts = [self._part(plan, rows[plan.use.name]) for plan in self._parts]
        if self._rates is not None:
            self._rates.feed(parts)
        joined = self._join.feed(parts)
        invalid = lacking(joined)
        if invalid is not None:
            fit = np.flatnonzero(~invalid)
            parts = [part.take(fit) for part in joined.parts]
            dropped, orphans = joined.place[invalid], joined.orphans
            joined = Joined(parts, joined.place[fit], joined.t_ns[fit], orphans)
        else:
            dropped = joined.place[:0]
        before = self._numbering.last
        sequence = first_of(part.sequence for part in joined.parts)
        time = first_of(part.time for part in joined.parts)
        zero = np.zeros(len(joined.place), np.int64)
        codes, status = codes_of(joined.parts, self._parts), status_of_parts(joined.parts, zero)
        numbered = self._numbering.number(
            joined.t_ns,
            zero if sequence is None else sequence,
            zero if time is None else time,
            codes,
        )
        number, duplicate, jump = numbered.number, numbered.duplicate, numbered.jump
        numbers = np.concatenate([number, [before]])

        def number_before(place: IntArray) -> IntArray:
            return numbers[np.searchsorted(joined.place, place, side="right") - 1]

        temp_place, temp_code, no_temp = self._temperatures(rows)
        temp_number = number_before(temp_place)
        known = temp_number >= 0
        lost, other = self._counters.feed(rows)
        error_at = np.flatnonzero(frames.is_error & rig.hears(frames))
        at_frames = [
            *((bad, BAD_CRC) for _, bad in found.values()),
            (joined.orphans, ORPHAN),
            (dropped, INVALID),
            (no_temp, INVALID),
            (lost, LOST_FRAME),
            (other, CONFLICT),
        ]
        told = [(number_before(place), kind) for place, kind in at_frames if len(place)]
        at_samples = ((duplicate, DUPLICATE), (numbered.conflict, CONFLICT))
        told += [(number[which], kind) for which, kind in at_samples if which.any()]
        trouble_number = [*(numbers for numbers, _ in told), number_before(error_at + seen)]
        trouble = [np.full(len(numbers), kind, np.int64) for numbers, kind in told]
        trouble.append(frames.can_id[error_at].astype(np.int64))
        new = ~duplicate
        if not new.all():
            number, codes, status, jump = number[new], codes[new], status[new], jump[new]
        return Samples(
            number=number,
            t_ns=joined.t_ns[new],
            codes=codes[:, :3],
            gyros=codes[:, 3:],
            status=status,
            jump=jump,
            temp_number=temp_number[known],
            temp_code=temp_code[known],
            serials=self._said(rows, rig.serial),
            rates=self._said(rows, rig.rate),
            trouble_number=np.concatenate(trouble_number),
            trouble=np.concatenate(trouble),
        )

    def _part(self, plan: PartPlan, rows: Rows) -> Part:
        """Columns of one part."""
        use = plan.use
        rows = rows.where(plan.conditions)
        clock = self._rig.sample_time
        axes, good = [], None
        for axis in plan.axes:
            numbers, there = self._number(use, self._rig.sampled[axis], rows, axis)
            axes.append(numbers)
            if there is not None:
                good = there if good is None else good & there
        mine = clock is not None and (clock.signal.message, clock.signal.conditions) == (
            use.name,
            plan.conditions,
        )
        return Part(
            place=rows.place,
            t_ns=rows.t_ns,
            sequence=use.sequence(rows.data) if use.name in self._counted and use.counter else None,
            time=clock.signal.signal.raw(rows.data) if clock is not None and mine else None,
            status=status_of(use, rows.data),
            axes=tuple(axes),
            good=good,
        )

    def _number(
        self, use: MessageUse, what: Recorded, rows: Rows, axis: int
    ) -> tuple[np.ndarray, BoolArray | None]:
        """What is recorded of an axis, and which of it are numbers."""
        signal = what.signal
        if not what.as_value:
            raw = signal.raw(rows.data).view(np.int64)
            return raw, available(use, signal, raw)
        there = available(use, signal, signal.number(rows.data))
        factor = self._coding.axes[axis] if axis < 3 else 1.0  # a gyro has no code of unit.toml
        return signal.value(rows.data) * factor, there

    def _temperatures(self, rows: Mapping[str, Rows]) -> tuple[IntArray, np.ndarray, IntArray]:
        """Places and codes of the thermometer, and places of those that are none."""
        what = self._rig.temperature
        if what is None:
            nothing = np.zeros(0, np.int64)
            return nothing, nothing, nothing
        use = self._rig.messages[what.message]
        mine = rows[what.message].where(what.conditions)
        signal = what.signal
        if what.as_value:
            good = available(use, signal, signal.number(mine.data))
            factor, shift = self._coding.temperature
            codes: np.ndarray = signal.value(mine.data) * factor + shift
        else:
            codes = signal.raw(mine.data).view(np.int64)
            good = available(use, signal, codes)
        status = None if what.message in self._rig.axis_messages else status_of(use, mine.data)
        if status is not None and status.any():
            good = (status == 0) if good is None else good & (status == 0)
        if good is None:
            return mine.place, codes, mine.place[:0]
        return mine.place[good], codes[good], mine.place[~good]

    def _said(self, rows: Mapping[str, Rows], what: SignalUnit | None) -> frozenset[int]:
        """Different values of an integer; it rarely changes, so most batches have one."""
        if what is None:
            return frozenset()
        mine = rows[what.message].where(what.conditions)
        if not len(mine):
            return frozenset()
        raw = what.signal.raw(mine.data)
        if raw[0] == raw[-1] and (raw == raw[0]).all():
            return frozenset((int(raw[0]),))
        return frozenset(np.unique(raw).tolist())
