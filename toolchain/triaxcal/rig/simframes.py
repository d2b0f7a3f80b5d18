"""Frames of the simulated rig: packed by the DBC, then spoiled to order."""

from __future__ import annotations

import numpy as np

from triaxcal.model.types import IntArray
from triaxcal.rig.dbc import FrameLayout, RigDbc
from triaxcal.rig.frames import BUS_OFF, ERR_FLAG, RESTARTED, Frames, alike, concatenate
from triaxcal.rig.simorders import Fault

_AFTER_NS = {"RIG_XY": 0, "RIG_Z": 150_000, "RIG_FD": 0, "RIG_TEMP": 300_000, "RIG_IDENT": 450_000}
"""Delay of each frame after its sample; at 1 Mbit/s a frame takes about 130 us."""


class FrameMaker:
    """Packs the samples of one rig, with its counters."""

    def __init__(self, dbc: RigDbc, layout: str, rate_hz: int, epoch_ns: int) -> None:
        self._messages = dbc.messages
        self._fd = layout == "fd"
        self._rate = rate_hz
        self._epoch_ns = epoch_ns
        self._sequence = self._time_us = 0
        self._temp_sequence = self._ident_sequence = 0

    def restart(self, sequence: int, time_us: int) -> None:
        """Start the counters anew."""
        self._sequence, self._time_us = sequence, time_us

    def frames(
        self,
        codes: IntArray,
        temp_codes: IntArray,
        second: int,
        serial_crc: int,
        status: int = 0,
    ) -> Frames:
        """Frames of one second: codes (rate, 3), thermometer's codes spread over the second."""
        n = len(codes)
        index = np.arange(n, dtype=np.int64)
        period_ns = 10**9 // self._rate
        t_ns = self._epoch_ns + second * 10**9 + index * period_ns
        sequence, time_us = self._sequence + index, self._time_us + index * (period_ns // 1000)
        self._sequence += n
        self._time_us += 10**6
        each = n // len(temp_codes)
        zero = np.zeros(n, np.int64)
        if self._fd:
            temps = temp_codes[np.minimum(index // each, len(temp_codes) - 1)]
            values = {"Sequence": sequence, "Status": zero + status, "TimeUs": time_us}
            values["TempCode"] = temps
            values |= {f"Accel{axis}": codes[:, i] for i, axis in enumerate("XYZ")}
            values |= {"SerialCrc": zero + serial_crc, "RateHz": zero + self._rate}
            return _packed(self._messages["RIG_FD"], values, t_ns)
        parts = [
            _packed(
                self._messages["RIG_XY"],
                {"Sequence": sequence, "AccelX": codes[:, 0], "AccelY": codes[:, 1]},
                t_ns,
            ),
            _packed(
                self._messages["RIG_Z"],
                {
                    "Sequence": sequence,
                    "AccelZ": codes[:, 2],
                    "TimeUs": time_us,
                    "Status": zero + status,
                },
                t_ns,
            ),
            self._temperatures(temp_codes, t_ns[::each][: len(temp_codes)]),
            self._identity(serial_crc, t_ns[:1]),
        ]
        frames = concatenate(parts)
        return frames.take(np.argsort(frames.t_ns, kind="stable"))

    def _temperatures(self, codes: IntArray, t_ns: IntArray) -> Frames:
        sequence = self._temp_sequence + np.arange(len(codes), dtype=np.int64)
        self._temp_sequence += len(codes)
        values = {"Sequence": sequence, "TempCode": codes, "Status": np.zeros(len(codes), np.int64)}
        return _packed(self._messages["RIG_TEMP"], values, t_ns)

    def _identity(self, serial_crc: int, t_ns: IntArray) -> Frames:
        one = np.ones(1, np.int64)
        values = {"Sequence": one * self._ident_sequence, "SerialCrc": one * serial_crc}
        self._ident_sequence += 1
        return _packed(self._messages["RIG_IDENT"], values | {"RateHz": one * self._rate}, t_ns)


def _packed(layout: FrameLayout, values: dict[str, IntArray], t_ns: IntArray) -> Frames:
    return layout.frames(values, t_ns + _AFTER_NS[layout.name])


def with_frame_faults(
    frames: Frames, faults: tuple[Fault, ...], epoch_ns: int, rng: np.random.Generator
) -> Frames:
    """Frames of a second as the bus gives them under the faults that fall into it."""
    if not len(frames):
        return frames
    for fault in faults:
        at_ns = epoch_ns + round(fault.at_s * 1e9)
        end_ns = at_ns + round(fault.length_s * 1e9)
        frames = _silenced(frames, fault, at_ns, end_ns)
        if not len(frames) or not frames.t_ns[0] <= at_ns <= frames.t_ns[-1]:
            continue
        first = int(np.searchsorted(frames.t_ns, at_ns))
        some = slice(first, first + int(fault.value))
        if fault.kind == "lose":
            keep = np.ones(len(frames), np.bool_)
            keep[some] = False
            frames = frames.take(keep)
        elif fault.kind == "duplicate":
            doubled = np.ones(len(frames), np.int64)
            doubled[some] = 2
            frames = frames.take(np.repeat(np.arange(len(frames)), doubled))
        elif fault.kind == "bitflip":
            data = frames.data.copy()
            for row in range(some.start, min(some.stop, len(data))):
                bit = int(rng.integers(8 * int(frames.length[row])))
                data[row, bit // 8] ^= np.uint8(1 << bit % 8)
            frames = Frames(frames.t_ns, frames.can_id, frames.length, frames.fd, data)
        elif fault.kind == "error":
            errors = _errors(at_ns, 0x8, int(fault.value), frames.data.shape[1])
            frames = concatenate(
                [frames.take(slice(0, first)), errors, frames.take(slice(first, None))]
            )
    return frames


def _silenced(frames: Frames, fault: Fault, at_ns: int, end_ns: int) -> Frames:
    """Without the frames of a silence; with the error frames of a bus-off at its ends."""
    if fault.kind not in {"busoff", "linkdown", "gone"} or not len(frames):
        return frames
    start, stop = int(frames.t_ns[0]), int(frames.t_ns[-1])
    kept = frames.take((frames.t_ns < at_ns) | (frames.t_ns >= end_ns))
    if fault.kind != "busoff":
        return kept
    width = frames.data.shape[1]
    early = kept.take(kept.t_ns < at_ns)
    late = kept.take(kept.t_ns >= end_ns)
    off = _errors(at_ns, BUS_OFF, int(start <= at_ns <= stop), width)
    on = _errors(end_ns, RESTARTED, int(start <= end_ns <= stop), width)
    return concatenate([early, off, on, late])


def _errors(t_ns: int, bits: int, count: int, width: int) -> Frames:
    times, data = np.full(count, t_ns, np.int64), np.zeros((count, width), np.uint8)
    return alike(times, ERR_FLAG | bits, 8, False, data)
