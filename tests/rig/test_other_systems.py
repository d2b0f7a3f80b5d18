"""What Windows and macOS lack is imported only where it is used."""

from __future__ import annotations

import subprocess
import sys

import pytest

ABSENT_MODULES = ("termios", "tty", "fcntl", "resource", "pwd")
PROGRAM = """
import importlib, os, pkgutil, signal, socket, sys
for name in {modules}:
    sys.modules[name] = None
for name in ("AF_CAN", "CAN_RAW", "SOL_CAN_RAW", "MSG_DONTWAIT", "SO_RCVBUFFORCE"):
    if hasattr(socket, name):
        delattr(socket, name)
if hasattr(signal, "SIGHUP"):
    del signal.SIGHUP
if hasattr(os, "sched_getaffinity"):
    del os.sched_getaffinity
import triaxcal.cli.entry, triaxcal.cli.main, triaxcal.cli.rig_live, triaxcal.cli.rig_fil
import triaxcal.batch.local
assert triaxcal.batch.local.cores() > 0
import triaxcal.rig as room
for module in pkgutil.walk_packages(room.__path__, "triaxcal.rig."):
    importlib.import_module(module.name)
"""


@pytest.mark.parametrize("absent", [ABSENT_MODULES, ()])
def test_every_module_of_the_bench_is_imported_without_what_linux_alone_has(absent):
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(modules=absent)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
