"""Samples out of frames: checked, paired, numbered, so that every loss is counted.

The samples do not depend on how the frames were cut into batches.

A sample's number grows by the sequence counter's step. The counter alone misses the loss of a
whole turn (256 samples of the classic layout), so the turns are taken from the time of arrival,
and the rig's own microseconds must then agree, or the sample is marked as a jump.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.model.types import IntArray
from triaxcal.rig.dbc import RigDbc
from triaxcal.rig.frames import BoolArray, Frames, concatenate

CLOCK_ERROR = 200e-6
"""How far the rig's clock and ours may differ, twice what a poor quartz does."""
_AXES = ("AccelX", "AccelY", "AccelZ")


@dataclass(frozen=True)
class Samples:
    """Samples in the order of their arrival.

    Attributes
    ----------
    number : int64 array, shape (n,)
        0, 1, 2, ... since the first; a number left out is a lost sample.
    t_ns : int64 array, shape (n,)
        Time of arrival.
    codes : int64 array, shape (n, 3)
        Raw codes, axis order x, y, z.
    status : int64 array, shape (n,)
        Status byte of the rig.
    jump : bool array, shape (n,)
        Sequence and the rig's time do not fit the sample before.
    temp_number, temp_code : int64 arrays, shape (m,)
        Codes of the thermometer, each with the number of the sample before it.
    identity : set of (serial CRC, rate in Hz)
        What the rig said of itself.
    trouble_number, trouble : int64 arrays, shape (k,)
        What went wrong, by the constants below or an error frame's ID with its flag, each with
        the number of the sample before it (-1: before the first).
    """

    number: IntArray
    t_ns: IntArray
    codes: IntArray
    status: IntArray
    jump: BoolArray
    temp_number: IntArray
    temp_code: IntArray
    identity: frozenset[tuple[int, int]]
    trouble_number: IntArray
    trouble: IntArray


BAD_CRC, ORPHAN, DUPLICATE = 1, 2, 3
"""A frame with a wrong CRC or length; one without its partner; a sample sent twice."""


@dataclass(frozen=True)
class _Raw:
    """Samples of a batch before they are numbered; `place` is where among its frames."""

    place: IntArray
    t_ns: IntArray
    sequence: IntArray
    time_us: IntArray
    codes: IntArray
    status: IntArray
    temp_place: IntArray
    temp_code: IntArray
    identity: frozenset[tuple[int, int]]
    bad_place: IntArray
    orphan_place: IntArray


@dataclass(frozen=True)
class _Last:
    """What the numbering remembers of the sample before."""

    number: int
    t_ns: int
    sequence: int
    time_us: int


class SampleDecoder:
    """Turns frames of one rig into samples, remembering what a batch leaves open.

    Parameters
    ----------
    layout : str
        "classic" or "fd".
    rate_hz : int
        Samples a second.
    """

    def __init__(self, dbc: RigDbc, layout: str, rate_hz: int) -> None:
        self._rate_hz = rate_hz
        self._fd = layout == "fd"
        self._messages = dbc.messages
        main = dbc.messages["RIG_FD" if self._fd else "RIG_Z"]
        self._sequence_turn = 1 << main.signals["Sequence"].length
        self._time_turn = 1 << main.signals["TimeUs"].length
        self._open: Frames | None = None
        self._last: _Last | None = None

    def feed(self, frames: Frames) -> Samples:
        """Samples that these frames complete."""
        if self._open is not None:
            frames = concatenate([self._open, frames])
            self._open = None
        raw = self._raw_fd(frames) if self._fd else self._raw_classic(frames)
        before = -1 if self._last is None else self._last.number
        number, duplicate, jump = self._number(raw)
        numbers = np.concatenate([number, [before]])

        def number_before(place: IntArray) -> IntArray:
            return numbers[np.searchsorted(raw.place, place, side="right") - 1]

        error_at = np.flatnonzero(frames.is_error)
        temp_number = number_before(raw.temp_place)
        known = temp_number >= 0
        new = ~duplicate
        kinds = (
            (number_before(raw.bad_place), BAD_CRC),
            (number_before(raw.orphan_place), ORPHAN),
            (number[duplicate], DUPLICATE),
        )
        return Samples(
            number=number[new],
            t_ns=raw.t_ns[new],
            codes=raw.codes[new],
            status=raw.status[new],
            jump=jump[new],
            temp_number=temp_number[known],
            temp_code=raw.temp_code[known],
            identity=raw.identity,
            trouble_number=np.concatenate(
                [*(numbers for numbers, _ in kinds), number_before(error_at)]
            ),
            trouble=np.concatenate(
                [
                    *(np.full(len(numbers), kind, np.int64) for numbers, kind in kinds),
                    frames.can_id[error_at].astype(np.int64),
                ]
            ),
        )

    def _valid(self, frames: Frames, name: str) -> tuple[IntArray, IntArray]:
        """Places of a message's good frames and of its bad ones."""
        layout = self._messages[name]
        places = np.flatnonzero(frames.can_id == layout.frame_id)
        good = layout.valid(frames.take(places))
        return places[good], places[~good]

    def _raw_classic(self, frames: Frames) -> _Raw:
        data = frames.data
        xy, z = self._messages["RIG_XY"], self._messages["RIG_Z"]
        (xy_at, bad_xy), (z_at, bad_z) = self._valid(frames, "RIG_XY"), self._valid(frames, "RIG_Z")
        temp_at, bad_temp = self._valid(frames, "RIG_TEMP")
        ident_at, bad_ident = self._valid(frames, "RIG_IDENT")
        first, second, orphan = self._pair(frames, xy_at, z_at)
        codes = (
            xy.raw("AccelX", data[first]),
            xy.raw("AccelY", data[first]),
            z.raw("AccelZ", data[second]),
        )
        ident = self._messages["RIG_IDENT"]
        return _Raw(
            place=second,
            t_ns=frames.t_ns[second],
            sequence=z.raw("Sequence", data[second]),
            time_us=z.raw("TimeUs", data[second]),
            codes=np.stack(codes, axis=1),
            status=z.raw("Status", data[second]),
            temp_place=temp_at,
            temp_code=self._messages["RIG_TEMP"].raw("TempCode", data[temp_at]),
            identity=_pairs(
                ident.raw("SerialCrc", data[ident_at]), ident.raw("RateHz", data[ident_at])
            ),
            bad_place=np.concatenate([bad_xy, bad_z, bad_temp, bad_ident]),
            orphan_place=orphan,
        )

    def _pair(
        self, frames: Frames, xy_at: IntArray, z_at: IntArray
    ) -> tuple[IntArray, IntArray, IntArray]:
        """Places of RIG_XY and RIG_Z that belong together, and of those alone.

        A RIG_XY at the very end stays open for the next batch.
        """
        places = np.concatenate([xy_at, z_at])
        order = np.argsort(places)
        places = places[order]
        is_z = order >= len(xy_at)
        sequence = np.concatenate(
            [
                self._messages["RIG_XY"].raw("Sequence", frames.data[xy_at]),
                self._messages["RIG_Z"].raw("Sequence", frames.data[z_at]),
            ]
        )[order]
        paired = np.flatnonzero(~is_z[:-1] & is_z[1:] & (sequence[:-1] == sequence[1:]))
        alone = np.ones(len(places), np.bool_)
        alone[paired] = alone[paired + 1] = False
        if len(places) and not is_z[-1]:
            self._open = frames.take(places[-1:])
            alone[-1] = False
        return places[paired], places[paired + 1], places[alone]

    def _raw_fd(self, frames: Frames) -> _Raw:
        places, bad = self._valid(frames, "RIG_FD")
        message = self._messages["RIG_FD"]
        data = frames.data[places]
        return _Raw(
            place=places,
            t_ns=frames.t_ns[places],
            sequence=message.raw("Sequence", data),
            time_us=message.raw("TimeUs", data),
            codes=np.stack([message.raw(axis, data) for axis in _AXES], axis=1),
            status=message.raw("Status", data),
            temp_place=places,
            temp_code=message.raw("TempCode", data),
            identity=_pairs(message.raw("SerialCrc", data), message.raw("RateHz", data)),
            bad_place=bad,
            orphan_place=np.zeros(0, np.int64),
        )

    def _number(self, raw: _Raw) -> tuple[IntArray, BoolArray, BoolArray]:
        """Numbers of the samples; which are sent twice; which do not fit the one before."""
        if not len(raw.t_ns):
            nothing = np.zeros(0, np.bool_)
            return np.zeros(0, np.int64), nothing, nothing
        last = self._last or _Last(-1, int(raw.t_ns[0]), int(raw.sequence[0]), int(raw.time_us[0]))
        turn = self._sequence_turn
        d_sequence = np.diff(raw.sequence, prepend=last.sequence) % turn
        d_time_us = np.diff(raw.time_us, prepend=last.time_us) % self._time_turn
        d_host_s = np.diff(raw.t_ns, prepend=last.t_ns) * 1e-9
        d_host = np.rint(d_host_s * self._rate_hz).astype(np.int64)
        duplicate = (d_sequence == 0) & (d_time_us == 0) & (d_host < turn // 2)
        step = d_sequence + turn * np.rint((d_host - d_sequence) / turn).astype(np.int64)
        period_us = 1e6 / self._rate_hz
        half = self._time_turn / 2
        off_us = np.abs((d_time_us - step * period_us + half) % self._time_turn - half)
        jump = (step <= 0) | (off_us > period_us / 4 + step * period_us * CLOCK_ERROR)
        step = np.where(jump, np.maximum(d_host, 1), step)
        if self._last is None:
            duplicate[0], jump[0], step[0] = False, False, 1
        step[duplicate] = 0
        jump &= ~duplicate
        number: IntArray = last.number + np.cumsum(step)
        self._last = _Last(
            int(number[-1]), int(raw.t_ns[-1]), int(raw.sequence[-1]), int(raw.time_us[-1])
        )
        return number, duplicate, jump


def _pairs(a: IntArray, b: IntArray) -> frozenset[tuple[int, int]]:
    """Different pairs of two columns; they rarely change, so most batches have one."""
    if not len(a):
        return frozenset()
    keys = np.unique(a * (1 << 16) + b)
    return frozenset((int(key) >> 16, int(key) & 0xFFFF) for key in keys)
