"""Python without what Windows and macOS lack: programs that begin with one of `SYSTEMS`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

WITHOUT = """
# Packages that take what their system has by the name of the system.
import contextlib
import click._termui_impl
with contextlib.suppress(ImportError):
    import serial
import os, select, signal, socket, sys, types
for name in {modules}:
    sys.modules[name] = None
for place, names in (
    (socket, ("AF_CAN", "PF_CAN", "CAN_RAW", "SOL_CAN_RAW", "MSG_DONTWAIT", "SO_RCVBUFFORCE")),
    (signal, ("SIGHUP",)),
    (os, ("fdatasync", "sched_getaffinity")),
):
    for name in names:
        if hasattr(place, name):
            delattr(place, name)
"""
WINDOWS = ("termios", "tty", "fcntl", "resource", "pwd", "grp", "pty")
MORE_OF_WINDOWS = """
for place, names in (
    (os, ("pread", "pwrite", "fork", "O_DIRECTORY", "getuid", "geteuid", "fchmod", "killpg")),
    (select, ("poll", "epoll")),
    (signal, ("SIGKILL", "SIGUSR1", "SIGALRM", "setitimer", "pthread_sigmask")),
    (socket, ("AF_UNIX", "SOCK_SEQPACKET", "recv_fds")),
):
    for name in names:
        if hasattr(place, name):
            delattr(place, name)
"""
CONSOLE = """
import importlib.machinery
import subprocess  # takes the system for Windows by this module
held = {}
console = types.ModuleType("msvcrt")
console.__spec__ = importlib.machinery.ModuleSpec("msvcrt", None)
console.LK_NBLCK, console.kbhit, console.getwch = 2, lambda: False, lambda: ""
def is_open(file, place):
    # Closing gives the lock back; a new file may get the number of one that is gone.
    try:
        return os.fstat(file).st_ino == place
    except OSError:
        return False
def locking(file, mode, count):
    assert (mode, count) == (2, 1)
    assert os.lseek(file, 0, os.SEEK_CUR) > 4096  # what others read is not locked
    place = os.fstat(file).st_ino
    if held.get(place, file) != file and is_open(held[place], place):
        raise PermissionError(13, "Permission denied")
    held[place] = file
console.locking = locking
sys.modules["msvcrt"] = console
"""
"""Stands for Windows' own module."""
TEXTS = """
import io, builtins, pathlib
_open = io.open
def windows_open(file, mode="r", buffering=-1, encoding=None, errors=None, newline=None, **more):
    if "b" in mode:
        return _open(file, mode, buffering, **more)
    if newline is None and set(mode) & set("wax+"):
        newline = "\\r\\n"
    return _open(file, mode, buffering, encoding or "cp1252", errors, newline, **more)
io.open = builtins.open = windows_open
"""
"""Windows' ends of lines and its encoding, where the code chooses none."""
SYSTEMS = {
    "macOS": WITHOUT.format(modules=()),
    "no locks": WITHOUT.format(modules=WINDOWS) + MORE_OF_WINDOWS,
    "Windows": WITHOUT.format(modules=WINDOWS) + MORE_OF_WINDOWS + CONSOLE + TEXTS,
}
RUN = """
import shlex
from triaxcal.cli.entry import entry
for line in sys.stdin.read().splitlines():
    sys.argv = ["triaxcal", *shlex.split(line)]
    try:
        entry()
        print("exit 0", flush=True)
    except SystemExit as end:
        print("exit", end.code, flush=True)
"""


def python(
    program: str, said: str = "", cwd: Path | None = None
) -> subprocess.CompletedProcess[str]:
    """What a program in a process of its own prints."""
    command = [sys.executable, "-c", program]
    return subprocess.run(command, input=said, capture_output=True, text=True, check=False, cwd=cwd)
