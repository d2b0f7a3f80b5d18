"""One process a folder: a lock that ends with its process, and says who holds it.

Linux and macOS lock an open file (flock), Windows a byte of it; the system lets go of both when the
process ends, whatever ended it. Where there is neither, and on file systems that cannot lock, the
lock is a file that exists, and a dead process is known by its number.
"""

from __future__ import annotations

import errno
import json
import os
import socket
from contextlib import suppress
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from triaxcal.base.durable import BINARY, write_all
from triaxcal.base.errors import RefusedError
from triaxcal.rig.records.journal import disk_refusal

_HELD = {errno.EAGAIN, errno.EACCES, errno.EDEADLK}
_BYTE_AT = 1 << 20
"""Byte that Windows locks: behind the text, which others must be able to read."""
_TEXT_BYTES = 4096


@dataclass(frozen=True)
class Holder:
    """Process that holds a lock."""

    pid: int
    since: str
    host: str

    @property
    def described(self) -> str:
        """Process, machine and time in words."""
        where = "" if self.host == socket.gethostname() else f" on {self.host}"
        return f"process {self.pid}{where}, started {self.since}"


class Lock:
    """A lock that is held from its making to `close`.

    Attributes
    ----------
    left_by : Holder or None
        Process that died with the lock; this one has taken it over.
    """

    def __init__(self, path: Path, what: str) -> None:
        """Take the lock.

        Parameters
        ----------
        path : Path
            File of the lock; it exists while the lock is held.
        what : str
            What it keeps from others, for the message.

        Raises
        ------
        RefusedError
            When another process holds it, with its number and start, or when the disk refuses.
        """
        self.path = path
        self._what = what
        self._file: int | None = None
        self.left_by: Holder | None = None
        now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
        self._own = Holder(os.getpid(), now, socket.gethostname())
        try:
            if not self._locked_file():
                self._existing_file()
        except OSError as error:
            raise disk_refusal(path, error) from error

    def _locked_file(self) -> bool:
        """Lock the open file; False where the system or the file system cannot."""
        while True:
            file = os.open(self.path, os.O_RDWR | os.O_CREAT | BINARY, 0o644)
            try:
                can_lock = _lock(file)
            except OSError as error:
                holder = _holder(_text(file))
                os.close(file)
                if error.errno in _HELD:
                    raise self._refusal(holder, "wait for it, or end it") from error
                raise
            if not can_lock:
                os.close(file)
                return False
            if _same_file(file, self.path):
                break
            os.close(file)  # its holder removed it between the two calls
        self._file = file
        self.left_by = _holder(_text(file))
        try:
            os.ftruncate(file, 0)
            os.lseek(file, 0, os.SEEK_SET)
            write_all(file, _line(self._own))
        except OSError:
            self.close()
            raise
        return True

    def _existing_file(self) -> None:
        """Make the file, complete from its first moment; take over that of a dead process."""
        aside = self.path.with_name(f"{self.path.name}.{os.getpid()}")
        aside.write_bytes(_line(self._own))
        try:
            while not _placed(aside, self.path):
                holder = self._found()
                if holder is not None and _alive(holder):
                    remedy = f"end it; if it is none of triaxcal's, remove {self.path.name}"
                    raise self._refusal(holder, remedy)
                self._remove_left(holder)
        finally:
            aside.unlink(missing_ok=True)

    def _found(self) -> Holder | None:
        try:
            return _holder(self.path.read_bytes())
        except FileNotFoundError:
            return None

    def _remove_left(self, holder: Holder | None) -> None:
        """Remove a dead process's file; another one that took it over meanwhile keeps its own."""
        moved = self.path.with_name(f"{self.path.name}.{os.getpid()}.left")
        with suppress(FileNotFoundError):
            self.path.replace(moved)
            if (found := _holder(moved.read_bytes())) != holder and found is not None:
                _placed(moved, self.path)
            moved.unlink()
        self.left_by = holder

    def _refusal(self, holder: Holder | None, remedy: str) -> RefusedError:
        who = holder.described if holder else "another process"
        return RefusedError(
            str(self.path.parent),
            f"{self._what} is under way in {who}",
            expected="one process",
            remedy=remedy,
        )

    def close(self) -> None:
        """Let go."""
        if self._file is None:
            if self._found() == self._own:
                self.path.unlink(missing_ok=True)
            return
        file, self._file = self._file, None
        with suppress(OSError):  # Windows removes no open file
            self.path.unlink()
        os.close(file)
        if os.name == "nt":
            with suppress(OSError):
                self.path.unlink()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        self.close()


def _lock(file: int) -> bool:
    """Lock an open file; False where that is not possible.

    Raises
    ------
    OSError
        With one of `_HELD` when another process holds it.
    """
    system: Any
    try:
        import fcntl as system  # noqa: PLC0415  not on Windows
    except ImportError:
        pass
    else:
        try:
            system.flock(file, system.LOCK_EX | system.LOCK_NB)
        except OSError as error:
            if error.errno in _HELD:
                raise
            return False  # a network's file system
        return True
    try:
        import msvcrt as system  # noqa: PLC0415  Windows alone
    except ImportError:
        return False
    os.lseek(file, _BYTE_AT, os.SEEK_SET)
    system.locking(file, system.LK_NBLCK, 1)
    return True


def _text(file: int) -> bytes:
    os.lseek(file, 0, os.SEEK_SET)
    return os.read(file, _TEXT_BYTES)


def _line(holder: Holder) -> bytes:
    return json.dumps(asdict(holder), sort_keys=True).encode() + b"\n"


def _holder(text: bytes) -> Holder | None:
    """Holder of a lock's text; None where it says nothing."""
    try:
        raw = json.loads(text)
        return Holder(int(raw["pid"]), str(raw["since"]), str(raw["host"]))
    except (ValueError, KeyError, TypeError):
        return None


def _same_file(file: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(file), path.stat())
    except FileNotFoundError:
        return False


def _placed(aside: Path, path: Path) -> bool:
    """Give a finished file its name; False when the name is taken."""
    try:
        os.link(aside, path)
    except FileExistsError:
        return False
    return True


def _alive(holder: Holder) -> bool:
    """Whether a process runs; one of another machine is taken to."""
    if holder.host != socket.gethostname():
        return True
    if os.name == "nt":
        return True  # os.kill would end it
    try:
        os.kill(holder.pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True
