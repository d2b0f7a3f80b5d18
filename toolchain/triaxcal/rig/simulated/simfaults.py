"""Faults of a bus, put into the frames of a simulated rig to order."""

from __future__ import annotations

import numpy as np

from triaxcal.rig.bus.frames import BUS_OFF, ERR_FLAG, RESTARTED, Frames, alike, concatenate
from triaxcal.rig.simulated.simorders import Fault


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
