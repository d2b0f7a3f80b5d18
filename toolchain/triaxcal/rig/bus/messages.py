"""Messages of python-can, to frames and back."""

from __future__ import annotations

import can
import numpy as np

from triaxcal.rig.bus.frames import (
    BRS,
    EFF_FLAG,
    ERR_FLAG,
    ESI,
    ID_MASK,
    RTR_FLAG,
    SENT,
    Frames,
    empty,
)


def frames_of(messages: list[can.Message]) -> Frames:
    """Frames of python-can messages."""
    if not messages:
        return empty()
    # Some files do not say that a frame is CAN FD, and some readers call an empty one remote.
    fd = [m.is_fd or len(m.data) > 8 for m in messages]
    remote = [m.is_remote_frame and not m.is_fd for m in messages]
    width = 64 if any(fd) else 8
    count = len(messages)
    payload = b"".join(bytes(m.data).ljust(width, b"\0") for m in messages)
    ids = [
        m.arbitration_id
        | (EFF_FLAG if m.is_extended_id and not m.is_error_frame else 0)
        | (RTR_FLAG if is_remote else 0)
        | (ERR_FLAG if m.is_error_frame else 0)
        for m, is_remote in zip(messages, remote, strict=True)
    ]
    lengths = [m.dlc if r else len(m.data) for m, r in zip(messages, remote, strict=True)]
    marks = [
        (BRS if m.bitrate_switch else 0)
        | (ESI if m.error_state_indicator else 0)
        | (0 if m.is_rx else SENT)
        for m in messages
    ]
    channels = [b"" if m.channel is None else str(m.channel).encode() for m in messages]
    return Frames(
        np.array([round(m.timestamp * 1e6) * 1000 for m in messages], np.int64),
        np.array(ids, np.uint32),
        np.array(lengths, np.uint8),
        np.array(fd, np.bool_),
        np.frombuffer(payload, np.uint8).reshape(count, width),
        np.array(marks, np.uint8),
        np.array(channels, np.bytes_),
    )


def messages_of(frames: Frames) -> list[can.Message]:
    """Python-can messages of frames."""
    rows = zip(
        frames.t_ns.tolist(),
        frames.can_id.tolist(),
        frames.length.tolist(),
        frames.fd.tolist(),
        frames.data,
        frames.marks.tolist(),
        frames.channel.tolist(),
        strict=True,
    )
    return [
        can.Message(
            timestamp=t_ns / 1e9,
            arbitration_id=can_id & ID_MASK,
            is_extended_id=bool(can_id & EFF_FLAG),
            is_remote_frame=bool(can_id & RTR_FLAG),
            is_error_frame=bool(can_id & ERR_FLAG),
            is_fd=fd,
            dlc=length,
            data=None if can_id & RTR_FLAG else data[:length].tobytes(),
            bitrate_switch=bool(marks & BRS),
            error_state_indicator=bool(marks & ESI),
            is_rx=not marks & SENT,
            channel=channel.decode() or None,
        )
        for t_ns, can_id, length, fd, data, marks, channel in rows
    ]
