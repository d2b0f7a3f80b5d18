"""The bench's own receiver for SocketCAN: a deep queue, every loss known, faults outlived.

python-can reads the same sockets, but never shows the kernel's count of frames that its queue
had no room for (SO_RXQ_OVFL), and does not outlive a device that goes away.
"""

from __future__ import annotations

import errno
import select
import socket
import struct
import time
from collections.abc import Callable

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.rig.bus.burst import (
    CLASSIC_BYTES,
    FD_BYTES,
    SO_RXQ_OVFL,
    SO_TIMESTAMPNS,
    BurstReceiver,
    struct_marks,
)
from triaxcal.rig.bus.frames import BRS, DLC_SHIFT, ESI, Frames, empty
from triaxcal.rig.sources.candevices import can_devices
from triaxcal.rig.sources.source import PACE_S, WAIT_S, Watched

QUEUE_BYTES = 4 << 20
_SO_RCVBUFFORCE = 33
_CAN_RAW_ERR_FILTER = 2
_FRAME_QUEUE_BYTES = 384
"""What the kernel charges a queue for one frame."""
_ENOUGH_S = 0.5
_FULL_RATE = 9000
_REOPEN_S = 0.2
_HEAD = struct.Struct("@IBBBB")
_GONE = {errno.ENODEV, errno.ENXIO, errno.EBADF, errno.ENETUNREACH}


class SocketSource(Watched):
    """Frames of a CAN device of Linux.

    Parameters
    ----------
    connect : callable
        Gives a connected socket; raises OSError when there is no such device.

    Attributes
    ----------
    dropped : int
        Frames that the kernel dropped because the queue was full.
    """

    def __init__(self, name: str, connect: Callable[[], socket.socket]) -> None:
        """Open the device.

        Raises
        ------
        RefusedError
            When there is no such device (names those that there are), or no permission.
        """
        super().__init__(name)
        self.dropped = 0
        self._connect = connect
        self._socket: socket.socket | None = None
        self._counted = 0
        self._burst = BurstReceiver()
        self._read_at = 0.0
        self._tried = time.monotonic()
        try:
            self._open()
        except OSError as error:
            raise open_refusal(name, error) from error

    def _open(self) -> None:
        opened = self._connect()
        opened.setblocking(False)
        try:
            opened.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, QUEUE_BYTES)
        except OSError:  # needs CAP_NET_ADMIN
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, QUEUE_BYTES)
        room = opened.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) // _FRAME_QUEUE_BYTES
        if room < _ENOUGH_S * _FULL_RATE:
            self._notes.append(
                f"{self.name}: the queue holds {room} frames, {1000 * room // _FULL_RATE} ms of a "
                "full bus; run as root, or raise net.core.rmem_max to 4194304"
            )
        for option in (SO_TIMESTAMPNS, SO_RXQ_OVFL):
            opened.setsockopt(socket.SOL_SOCKET, option, 1)
        self._counted = 0
        self._socket = opened

    def read(self) -> Frames:
        """Frames that have come; waits a little when there are none."""
        if self._socket is None:
            self._reopen()
            return empty()
        ready, _, _ = select.select([self._socket], [], [], WAIT_S)
        frames = empty()
        if ready:
            time.sleep(max(0.0, self._read_at + PACE_S - time.monotonic()))
            self._read_at = time.monotonic()
            frames = self._receive(self._socket)
        # A removed device says so once, and one that came back under its name never does:
        # a socket that stays silent is made anew.
        if self._watch(bool(len(frames))) and time.monotonic() - self._tried > 1.0:
            self._close()
            self._tried = time.monotonic() - _REOPEN_S
        return frames

    def _receive(self, link: socket.socket) -> Frames:
        try:
            burst = self._burst.receive(link)
        except BlockingIOError:
            return empty()
        except OSError as error:
            self._fault(error)
            return empty()
        if burst.drops is not None and burst.drops != self._counted:
            new = (burst.drops - self._counted) % 2**32
            self._notes.append(f"{self.name}: the kernel dropped {new} frames, queue full")
            self.dropped += new
            self._counted = burst.drops
        if burst.ended:
            self._fault(OSError(errno.ENODEV, "closed"))
        t_ns = burst.frames.t_ns
        t_ns[t_ns == 0] = time.time_ns()
        return burst.frames

    def _fault(self, error: OSError) -> None:
        if error.errno == errno.ENETDOWN:
            self._down = True
            self._notes.append(f"{self.name}: the link is down; `ip link set {self.name} up`")
            return
        self._notes.append(f"{self.name}: {(error.strerror or str(error)).lower()}")
        if error.errno in _GONE:
            self._close()

    def _reopen(self) -> None:
        time.sleep(WAIT_S)
        if time.monotonic() - self._tried < _REOPEN_S:
            return
        self._tried = time.monotonic()
        try:
            self._open()
        except OSError:
            return
        self._notes.append(f"{self.name}: the device is back")

    def _close(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def close(self) -> None:
        """Close the socket."""
        self._close()


def can_socket(device: str, fd: bool) -> socket.socket:
    """Raw socket of a CAN device, error frames included.

    Raises
    ------
    OSError
        When there is no such device, no SocketCAN, or no permission.
    """
    opened = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    try:
        everything = struct.pack("@I", 0x1FFFFFFF)
        opened.setsockopt(socket.SOL_CAN_RAW, _CAN_RAW_ERR_FILTER, everything)
        if fd:
            opened.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
        opened.bind((device,))
    except BaseException:
        opened.close()
        raise
    return opened


def packed(frames: Frames) -> list[bytes]:
    """Frames as struct can_frame or canfd_frame, to be sent."""
    rows = zip(
        frames.can_id.tolist(), frames.length.tolist(), frames.fd.tolist(), frames.marks.tolist(),
        frames.data, strict=True
    )  # fmt: skip
    return [
        _HEAD.pack(can_id, length, marks & (BRS | ESI) if fd else 0, 0, marks >> DLC_SHIFT)
        + data.tobytes()[: 64 if fd else 8].ljust(64 if fd else 8, b"\0")
        for can_id, length, fd, marks, data in rows
    ]


def frames_of_rows(rows: list[tuple[int, bytes]]) -> Frames:
    """Frames of times in ns and struct can_frame or canfd_frame; what is neither is left out."""
    rows = [row for row in rows if len(row[1]) in {CLASSIC_BYTES, FD_BYTES}]
    if not rows:
        return empty()
    wide = any(len(payload) == FD_BYTES for _, payload in rows)
    size = FD_BYTES if wide else CLASSIC_BYTES
    text = b"".join(payload.ljust(size, b"\0") for _, payload in rows)
    table = np.frombuffer(text, np.uint8).reshape(len(rows), size)
    fd = np.array([len(payload) == FD_BYTES for _, payload in rows], np.bool_)
    return Frames(
        np.array([t_ns for t_ns, _ in rows], np.int64),
        table[:, :4].copy().view(np.uint32)[:, 0],
        table[:, 4],
        fd,
        table[:, 8:],
        struct_marks(table, fd),
    )


def open_refusal(name: str, error: OSError) -> RefusedError:
    """Error of a CAN device that cannot be opened: says why, and which devices there are."""
    if error.errno in {errno.EPERM, errno.EACCES}:
        return RefusedError(name, "no permission", remedy="run as a user that may open CAN sockets")
    if error.errno in {errno.EAFNOSUPPORT, errno.EPROTONOSUPPORT}:
        return RefusedError(
            name, "the kernel has no SocketCAN", remedy="sudo modprobe can-raw, or another machine"
        )
    there = ", ".join(can_devices()) or "none"
    return RefusedError(
        name,
        f"cannot be opened: {(error.strerror or str(error)).lower()}",
        remedy=f"CAN devices of this machine: {there}",
    )
