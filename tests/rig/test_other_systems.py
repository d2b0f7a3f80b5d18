"""What Windows and macOS lack is used only where it is there: a whole session without it."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from rig_cases import short_setup
from test_cli_rig import bench_copy

WITHOUT = """
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
    (signal, ("SIGKILL", "SIGUSR1", "SIGALRM", "setitimer")),
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
SYSTEMS = {
    "macOS": WITHOUT.format(modules=()),
    "no locks": WITHOUT.format(modules=WINDOWS) + MORE_OF_WINDOWS,
    "Windows": WITHOUT.format(modules=WINDOWS) + MORE_OF_WINDOWS + CONSOLE,
}
IMPORTED = """
import importlib, pkgutil
import triaxcal.cli.entry, triaxcal.cli.main, triaxcal.cli.rig_live, triaxcal.cli.rig_fil
import triaxcal.batch.local
assert triaxcal.batch.local.cores() > 0
import triaxcal.rig as room
for module in pkgutil.walk_packages(room.__path__, "triaxcal.rig."):
    importlib.import_module(module.name)
"""
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


def python(program, said=""):
    return subprocess.run(
        [sys.executable, "-c", program], input=said, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize("system", SYSTEMS)
def test_every_module_of_the_bench_is_imported_without_what_linux_alone_has(system):
    done = python(SYSTEMS[system] + IMPORTED)
    assert done.returncode == 0, done.stderr


@pytest.mark.long
@pytest.mark.parametrize("system", SYSTEMS)
def test_a_whole_session_and_every_command_about_it(tmp_path, system):
    unit = bench_copy(tmp_path)
    setup = short_setup(tmp_path, temps="[20]")
    common = f"--unit {unit} --plan {setup.plan.source}"
    log = unit / "sessions" / "001" / "frames.log"
    lines = [
        f"rig check --bus virtual {common}",
        f"rig run --bus virtual --plain {common} --fault slip@84:150",
        f"rig resume --bus virtual --plain {common}",
        f"rig status {common}",
        f"rig replay {common} --into {tmp_path} {log}",
        f"rig export {log} {tmp_path / 'x.blf'}",
        f"rig replay {common} --into {tmp_path} {tmp_path / 'x.blf'}",
        f"rig run --bus can0 {common}",
    ]
    done = python(SYSTEMS[system] + RUN, "\n".join(lines))
    ends = [line for line in done.stdout.splitlines() if line.startswith("exit")]
    assert ends == [*["exit 0"] * 7, "exit 1"], done.stdout[-3000:] + done.stderr[-3000:]
    assert "Traceback" not in done.stderr
    assert "this system has no SocketCAN; expected an interface of python-can" in done.stderr
    assert done.stdout.count("6 accepted dwells") >= 2
    for name in ("measurements.csv", "measurements.json"):
        again = (tmp_path / name).read_bytes()
        kept = [p.read_bytes() for p in tmp_path.glob(f"{name.split('.')[0]}.2*")]
        assert (unit / name).read_bytes() in {again, *kept}
    assert not list(log.parent.glob("*.lock*"))


def test_two_sessions_on_windows(tmp_path):
    """The lock of a byte, by the stand-in: refused while it is held, free when it is let go of."""
    program = (
        SYSTEMS["Windows"]
        + """
from pathlib import Path
from triaxcal.base.errors import RefusedError
from triaxcal.rig.records.lock import Lock
path = Path(os.environ["LOCK"])
first = Lock(path, "a session")
try:
    Lock(path, "a session")
except RefusedError as refusal:
    print(refusal)
held.clear()
first.close()
Lock(path, "a session").close()
print(path.exists())
"""
    )
    environment = {**os.environ, "LOCK": str(tmp_path / "session.lock")}
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False,
        env=environment,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    first, second = done.stdout.splitlines()
    assert "a session is under way in process " in first
    assert second == "False"
