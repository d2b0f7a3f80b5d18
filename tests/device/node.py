"""The example node as a process, and our end of its bus."""

from __future__ import annotations

import contextlib
import socket
import struct
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from builds import Built
from device.conftest import HERE, compile_with

EXAMPLE = HERE.parent.parent / "examples" / "xcp-node"
REQUEST, RESPONSE = 0x650, 0x651
_FRAME = struct.Struct("<IB3x8s")
POWER_FAILED = 9


def build_node(b: Built, out: Path, *more: str) -> Path:
    sources = (EXAMPLE / "xcp_node.c", EXAMPLE / "flash_file.c", b.folder / "triax_calib.c")
    return compile_with(b, out, *sources, f"-I{EXAMPLE}", *more)


@dataclass
class Node:
    """A program, its flash and its sensor; `on` gives it power."""

    program: Path
    flash: Path
    samples: Path
    code: int | None = None

    @contextlib.contextmanager
    def on(self, stop: int | None = None) -> Iterator[socket.socket]:
        """Our end of the socket; afterwards `code` is what the node ended with."""
        link, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        number = str(theirs.fileno())
        last = [] if stop is None else [str(stop)]
        command = [str(self.program), "socket", number, str(self.flash), str(self.samples), *last]
        process = subprocess.Popen(command, pass_fds=[theirs.fileno()])
        theirs.close()
        try:
            yield link
        finally:
            link.close()
            self.code = process.wait(10)

    @contextlib.contextmanager
    def on_can(self, device: str, stop: int | None = None) -> Iterator[None]:
        """On a CAN device; when its power is switched off, `code` is negative."""
        last = [] if stop is None else [str(stop)]
        command = [str(self.program), "can", device, str(self.flash), str(self.samples), *last]
        process = subprocess.Popen(command)
        try:
            yield
        finally:
            process.terminate()
            self.code = process.wait(10)


def write_samples(path: Path, temp: np.ndarray, raw: np.ndarray) -> None:
    path.write_bytes(np.column_stack([temp, raw]).astype("<i4").tobytes())


def frame(data: bytes, can_id: int = REQUEST) -> bytes:
    return _FRAME.pack(can_id, len(data), data.ljust(8, b"\0"))


def ask(link: socket.socket, *command: int | bytes) -> bytes:
    """The answer; b"" where the node is gone."""
    data = b"".join(c if isinstance(c, bytes) else bytes([c]) for c in command)
    try:
        link.send(frame(data))
        answer = link.recv(16)
    except (BrokenPipeError, ConnectionResetError):
        return b""
    if not answer:
        return b""
    can_id, size, content = _FRAME.unpack(answer)
    assert can_id == RESPONSE
    return content[:size]
