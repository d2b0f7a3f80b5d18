"""Frames of the simulated rig: packed through cantools."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from triaxcal.model.types import IntArray
from triaxcal.rig.bus.frames import (
    Frames,
    alike,
    concatenate,
    widened,
)
from triaxcal.rig.description.busfile import read_bus_file
from triaxcal.rig.description.description import MessageUse, RigDescription
from triaxcal.rig.description.layout import Condition
from triaxcal.rig.description.recorded import Recorded, SignalUnit
from triaxcal.rig.plan.nominal import AS_SENT, Coding
from triaxcal.rig.simulated.simpack import Packer

_APART_NS = 150_000
"""From frame to frame of a sample; at 1 Mbit/s a frame takes about 130 us."""
_FLOATS = {16: ("<f2", "<u2"), 32: ("<f4", "<u4"), 64: ("<f8", "<u8")}
_AXES, _TEMPERATURE, _IDENTITY = range(3)


@dataclass(frozen=True)
class _Kind:
    """One kind of frame: a message, in one case of its multiplexers.

    Attributes
    ----------
    often : int
        With each sample, with each temperature, or once a second.
    place : int
        Among the frames of a sample, from 0.
    of_message : tuple of int
        Its place among the kinds of the message, and their number.
    """

    use: MessageUse
    conditions: tuple[Condition, ...]
    packer: Packer
    often: int
    place: int
    of_message: tuple[int, int]


class FrameMaker:
    """Packs the samples of one rig, with its counters.

    Parameters
    ----------
    coding : Coding
        How the rig's values become codes.
    """

    def __init__(
        self, rig: RigDescription, rate_hz: int, epoch_ns: int, coding: Coding = AS_SENT
    ) -> None:
        self._rig = rig
        self._coding = coding
        self._rate = rate_hz
        self._epoch_ns = epoch_ns
        self._sequence = self._time_us = 0
        self._kinds = _kinds(rig)
        self._sent = dict.fromkeys(rig.messages, 0)

    def restart(self, sequence: int, time_us: int) -> None:
        """Start the counters anew."""
        self._sequence, self._time_us = sequence, time_us

    def frames(  # noqa: PLR0917
        self,
        codes: IntArray,
        temp_codes: IntArray,
        second: int,
        serial: int,
        status: int = 0,
        temperature: bool = True,
    ) -> Frames:
        """Frames of one second: codes (rate, 3), thermometer's codes spread over the second.

        Parameters
        ----------
        serial : int
            Serial number as the rig sends it.
        status : int
            Bits in which the status differs from a good one.
        temperature : bool
            Whether frames that have nothing but the temperature are sent.
        """
        n = len(codes)
        index = np.arange(n, dtype=np.int64)
        period_ns = 10**9 // self._rate
        t_ns = self._epoch_ns + second * 10**9 + index * period_ns
        each = n // len(temp_codes)
        rows = {
            _AXES: index,
            _TEMPERATURE: index[::each][: len(temp_codes)],
            _IDENTITY: index[:1],
        }
        temps = temp_codes[np.minimum(index // each, len(temp_codes) - 1)]
        numbers = self._numbers(codes, temps, serial, self._time_us + index * (period_ns // 1000))
        parts = []
        for kind in self._kinds:
            mine = rows[kind.often]
            if kind.often == _TEMPERATURE and not temperature:
                continue
            parts.append(self._packed(kind, numbers, mine, t_ns, status))
        self._sequence += n
        self._time_us += 10**6
        for name in self._sent:
            kinds = [k for k in self._kinds if k.use.name == name]
            self._sent[name] += sum(len(rows[k.often]) for k in kinds)
        frames = concatenate(parts)
        return frames.take(np.argsort(frames.t_ns, kind="stable"))

    def _numbers(
        self, codes: IntArray, temps: IntArray, serial: int, time_us: IntArray
    ) -> dict[tuple[str, str], IntArray]:
        """Raw integers (n,) of the signals of [signals], by message and signal."""
        rig, zero = self._rig, np.zeros(len(codes), np.int64)
        found = {
            _key(axis): _sent(axis, codes[:, i], self._coding.axes[i], 0.0)
            for i, axis in enumerate(rig.axes)
        }
        found |= {_key(gyro): _sent(gyro, _still(gyro, zero), 1.0, 0.0) for gyro in rig.gyros}
        if rig.temperature is not None:
            found[_key(rig.temperature)] = _sent(rig.temperature, temps, *self._coding.temperature)
        if rig.sample_time is not None:
            clock = rig.sample_time
            found[_key(clock.signal)] = (time_us / clock.tick_us).astype(np.int64) % clock.turn
        if rig.serial is not None:
            found[_key(rig.serial)] = zero + serial
        if rig.rate is not None:
            signal = rig.rate.signal
            found[_key(rig.rate)] = zero + round((self._rate - signal.offset) / signal.scale)
        return found

    def _packed(
        self,
        kind: _Kind,
        numbers: Mapping[tuple[str, str], IntArray],
        rows: IntArray,
        t_ns: IntArray,
        status: int,
    ) -> Frames:
        use, layout = kind.use, kind.use.layout
        zero = np.zeros(len(rows), np.int64)
        raw = {
            signal: column[rows]
            for (message, signal), column in numbers.items()
            if message == use.name and layout.multiplexed.get(signal, ()) == kind.conditions
        }
        raw |= {
            signal: column[rows]
            for (message, signal), column in numbers.items()
            if message == use.name and not layout.multiplexed.get(signal)
        }
        if use.counter is not None:
            raw[use.counter.name] = (
                self._counter(kind, rows) * use.counter_step % use.counter_modulus
            )
        for one in use.statuses:
            raw[one.signal.name] = zero + (one.good[0] ^ status)
        for condition in use.only:
            raw[condition.selector.name] = zero + condition.values[0]
        data = kind.packer.pack(raw)
        if use.guard is not None and use.protection is not None:
            use.protection.fill(use.guard, data)
            crc = use.protection.crc(use.guard, data)
            data += kind.packer.pack({use.guard.signal.name: crc}) - kind.packer.pack(
                {use.guard.signal.name: zero}
            )
        data = widened(data, 64 if layout.fd else 8)
        at = t_ns[rows] + kind.place * _APART_NS
        return alike(at, layout.can_id, layout.sent_bytes, layout.fd, data)

    def _counter(self, kind: _Kind, rows: IntArray) -> IntArray:
        """Counter: of the samples where they are joined by it, else of the message's frames."""
        if kind.often == _AXES and kind.of_message[1] == 1:
            return self._sequence + rows
        if kind.often == _AXES and self._rig.join == "counter":
            return self._sequence + rows
        at, count = kind.of_message
        return self._sent[kind.use.name] + np.arange(len(rows)) * count + at


def _key(what: SignalUnit) -> tuple[str, str]:
    return what.message, what.signal.name


def _sent(what: Recorded, codes: IntArray, factor: float, shift: float) -> IntArray:
    """Raw integers that are sent for codes (n,)."""
    signal = what.signal
    if not what.as_value:
        return codes
    numbers = np.asarray(((codes - shift) / factor - signal.offset) / signal.scale, np.float64)
    if not signal.is_float:
        return np.rint(numbers).astype(np.int64)
    kind, whole = _FLOATS[signal.length]
    return numbers.astype(kind).view(whole).astype(np.int64)


def _still(gyro: Recorded, zero: IntArray) -> IntArray:
    """What is recorded of a gyro that does not turn."""
    return zero if gyro.as_value else zero + round(-gyro.zero / gyro.step)


def _kinds(rig: RigDescription) -> list[_Kind]:
    """Kinds of frames that carry a signal of [signals]."""
    often: dict[tuple[str, tuple[Condition, ...]], int] = {}
    for axis in rig.sampled:
        often.setdefault((axis.message, axis.conditions), _AXES)
    for what, how in (
        (rig.temperature, _TEMPERATURE),
        (rig.serial, _IDENTITY),
        (rig.rate, _IDENTITY),
    ):
        if what is None:
            continue
        always = not what.conditions and any(m == what.message for m, _ in often)
        if not always:
            often.setdefault((what.message, what.conditions), how)
    messages = {m.name: m for path in rig.bus_files for m in read_bus_file(path).database.messages}
    kinds = []
    for place, ((name, conditions), how) in enumerate(often.items()):
        use = rig.messages[name]
        selected = {c.selector.name: c.values[0] for c in conditions}
        selected = {**_first_cases(use), **selected}
        same = [key for key in often if key[0] == name]
        kinds.append(
            _Kind(
                use,
                conditions,
                Packer(messages[name], selected),
                how,
                place,
                (same.index((name, conditions)), len(same)),
            )
        )
    return kinds


def _first_cases(use: MessageUse) -> dict[str, int]:
    """A legal raw value of each multiplexer of a message."""
    found: dict[str, int] = {}
    for conditions in use.layout.multiplexed.values():
        for condition in conditions:
            found.setdefault(condition.selector.name, condition.values[0])
    return found
