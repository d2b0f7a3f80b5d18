"""Files that outlive a crash: content on the disk before its name is, names in one step."""

from __future__ import annotations

import ctypes
import os
import tempfile
from contextlib import suppress
from pathlib import Path

BINARY = getattr(os, "O_BINARY", 0)
"""For `os.open`: Windows alone would change the ends of lines."""
_AT_CWD = -100
_EXCHANGE = 2


def write_all(file: int, content: bytes) -> None:
    """Write all of it: the system may take a part only."""
    view = memoryview(content)
    while view:
        view = view[os.write(file, view) :]


def sync_data(file: int) -> None:
    """Wait until the disk has the content of an open file."""
    getattr(os, "fdatasync", os.fsync)(file)  # Linux alone can leave out the times of the file


def sync_folder(folder: Path) -> None:
    """Make the names in a folder survive a power cut; Windows opens no folder, and needs none."""
    if not hasattr(os, "O_DIRECTORY"):
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def write_durably(path: Path, content: bytes) -> None:
    """Write a file and wait until the disk has its content; its name is the folder's business.

    Raises
    ------
    OSError
        When the disk refuses.
    """
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def replace_file(path: Path, content: bytes) -> None:
    """Give a file new content in one step: after a crash it has the old or the new one.

    Raises
    ------
    OSError
        When the disk refuses; the file is then as it was.
    """
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    aside = Path(name)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        aside.chmod(0o666 & ~umask())
        aside.replace(path)
        sync_folder(path.parent)
    finally:
        aside.unlink(missing_ok=True)


def exchange(one: Path, other: Path) -> bool:
    """Let two names of one file system change places in one step; False where none can do that.

    Linux has renameat2(2) for it, macOS renamex_np(2); Windows has nothing.
    """
    names = os.fsencode(one), os.fsencode(other)
    with suppress(AttributeError, OSError, TypeError):
        system = ctypes.CDLL(None)
        if hasattr(system, "renameat2"):
            return bool(system.renameat2(_AT_CWD, names[0], _AT_CWD, names[1], _EXCHANGE) == 0)
        return bool(system.renamex_np(*names, _EXCHANGE) == 0)
    return False


def umask() -> int:
    """Permissions that new files of this process do not get."""
    current = os.umask(0o022)
    os.umask(current)
    return current
