"""Many frames with one system call: Linux's recvmmsg into one block of memory.

Python's own recvmsg costs some microseconds a frame, most of the time that a frame may take on a
full bus. The layout of struct mmsghdr is ctypes' business, that of the control messages cmsg(3)'s.
"""

from __future__ import annotations

import ctypes
import os
import socket
from dataclasses import dataclass

import numpy as np

from triaxcal.model.types import IntArray
from triaxcal.rig.bus.frames import BRS, DLC_SHIFT, ESI, SENT, BoolArray, ByteArray, Frames

CLASSIC_BYTES, FD_BYTES = 16, 72
"""Sizes of struct can_frame and canfd_frame."""
MOST = 4096
SO_TIMESTAMPNS, SO_RXQ_OVFL = 35, 40
_CONTROL_BYTES = 128
_HEADER_BYTES = 16  # struct cmsghdr: size_t, int, int
_MSG_DONTROUTE = 4
"""Of a received frame: another program of this machine has sent it."""
_DONT_WAIT = getattr(socket, "MSG_DONTWAIT", 0)  # not on Windows, which has no SocketCAN


class _Part(ctypes.Structure):
    """struct iovec."""

    _fields_ = (("base", ctypes.c_void_p), ("size", ctypes.c_size_t))


class _Header(ctypes.Structure):
    """struct msghdr."""

    _fields_ = (
        ("name", ctypes.c_void_p),
        ("name_size", ctypes.c_uint),
        ("parts", ctypes.c_void_p),
        ("part_count", ctypes.c_size_t),
        ("control", ctypes.c_void_p),
        ("control_size", ctypes.c_size_t),
        ("flags", ctypes.c_int),
    )


class _Message(ctypes.Structure):
    """struct mmsghdr."""

    _fields_ = (("header", _Header), ("received", ctypes.c_uint))


@dataclass(frozen=True)
class Burst:
    """What one call gave.

    Attributes
    ----------
    t_ns : int64 array, shape (n,)
        Kernel's time of arrival, 0 where it gave none.
    drops : int or None
        Kernel's count of dropped frames with the last message that carried one.
    ended : bool
        The other side has closed.
    """

    frames: Frames
    drops: int | None
    ended: bool


class BurstReceiver:
    """Memory for `MOST` frames, used again with each call."""

    def __init__(self) -> None:
        self._call = ctypes.CDLL(None, use_errno=True).recvmmsg
        self._data = np.zeros((MOST, FD_BYTES), np.uint8)
        self._control = np.zeros((MOST, _CONTROL_BYTES), np.uint8)
        self._parts = (_Part * MOST)()
        table = np.zeros((MOST, ctypes.sizeof(_Message)), np.uint8)
        self._messages = (_Message * MOST).from_buffer(table.data)
        control_size_at = _Message.header.offset + _Header.control_size.offset
        self._received = _column(table, _Message.received.offset, np.uint32)
        self._control_size = _column(table, control_size_at, np.uint64)
        flags_at = _Message.header.offset + _Header.flags.offset
        self._flags = _column(table, flags_at, np.int32)
        data, control = self._data.ctypes.data, self._control.ctypes.data
        part = ctypes.addressof(self._parts)
        for i, message in enumerate(self._messages):
            header = message.header
            self._parts[i] = _Part(data + i * FD_BYTES, FD_BYTES)
            header.parts, header.part_count = part + i * ctypes.sizeof(_Part), 1
            header.control = control + i * _CONTROL_BYTES

    def receive(self, link: socket.socket) -> Burst:
        """Frames that wait in a socket; messages that are no frames are left out.

        Raises
        ------
        OSError
            As recvmmsg(2); BlockingIOError when nothing waits.
        """
        self._control_size[:] = _CONTROL_BYTES
        count = self._call(link.fileno(), self._messages, MOST, _DONT_WAIT, None)
        if count < 0:
            number = ctypes.get_errno()
            raise OSError(number, os.strerror(number))
        received = self._received[:count]
        t_ns, drops = self._marks(count)
        good = np.flatnonzero((received == CLASSIC_BYTES) | (received == FD_BYTES))
        fd = received[good] == FD_BYTES
        rows = self._data[good] if fd.any() else self._data[good, :CLASSIC_BYTES]
        data = rows[:, 8:]
        if fd.any():
            data[~fd, CLASSIC_BYTES - 8 :] = 0  # of an earlier, longer frame
        can_id = np.ascontiguousarray(rows[:, :4]).view(np.uint32)[:, 0]
        frames = Frames(t_ns[good], can_id, rows[:, 4], fd, data, self._frame_marks(good, rows, fd))
        return Burst(frames, drops, bool((received == 0).any()))

    def _frame_marks(self, good: IntArray, rows: ByteArray, fd: BoolArray) -> ByteArray:
        """Marks of frames (n,): those of their structures, and what this machine sent."""
        marks = struct_marks(rows, fd)
        marks[(self._flags[good] & _MSG_DONTROUTE) != 0] |= SENT
        return marks

    def _marks(self, count: int) -> tuple[IntArray, int | None]:
        """Times (n,) and the last drop count, out of the control messages."""
        t_ns = np.zeros(count, np.int64)
        drops: int | None = None
        at = np.zeros(count, np.int64)
        ends = self._control_size[:count].astype(np.int64)
        rows = np.flatnonzero(at + _HEADER_BYTES <= ends)
        while len(rows):
            size = _values(self._control, rows, at[rows], np.int64)
            level = _values(self._control, rows, at[rows] + 8, np.int32)
            kind = _values(self._control, rows, at[rows] + 12, np.int32)
            ours = level == socket.SOL_SOCKET
            timed = rows[ours & (kind == SO_TIMESTAMPNS)]
            if len(timed):
                inside = at[timed] + _HEADER_BYTES
                seconds = _values(self._control, timed, inside, np.int64)
                t_ns[timed] = seconds * 10**9
                t_ns[timed] += _values(self._control, timed, inside + 8, np.int64)
            counted = rows[ours & (kind == SO_RXQ_OVFL)][-1:]
            if len(counted):
                drops = int(
                    _values(self._control, counted, at[counted] + _HEADER_BYTES, np.uint32)[0]
                )
            at[rows] += np.maximum((size + 7) // 8 * 8, _HEADER_BYTES)
            rows = rows[at[rows] + _HEADER_BYTES <= ends[rows]]
        return t_ns, drops


def struct_marks(rows: ByteArray, fd: BoolArray) -> ByteArray:
    """Marks (n,) of struct can_frame or canfd_frame: flags in byte 5, the raw code in byte 7."""
    raw = (rows[:, 4] == CLASSIC_BYTES - 8) & (rows[:, 7] > CLASSIC_BYTES - 8)
    code = np.where(raw, rows[:, 7] & 15, 0)
    return np.where(fd, rows[:, 5] & (BRS | ESI), code << DLC_SHIFT).astype(np.uint8)


def _column(table: ByteArray, offset: int, kind: type) -> np.ndarray:
    """One field of every header, as a view."""
    width = np.dtype(kind).itemsize
    return table[:, offset : offset + width].view(kind)[:, 0]


def _values(table: ByteArray, rows: IntArray, at: IntArray, kind: type) -> np.ndarray:
    """Numbers of the host's byte order at places `at` (n,) of the rows."""
    width = np.dtype(kind).itemsize
    picked = table[rows[:, None], at[:, None] + np.arange(width)]
    return np.ascontiguousarray(picked).view(kind)[:, 0]
