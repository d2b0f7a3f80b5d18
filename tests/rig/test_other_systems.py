"""What Windows and macOS lack is used only where it is there: a whole session without it."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from rig_cases import short_setup
from test_cli_rig import bench_copy

from systems import RUN, SYSTEMS, python

IMPORTED = """
import importlib, pkgutil
import triaxcal.cli.entry, triaxcal.cli.main, triaxcal.cli.rig_live, triaxcal.cli.rig_fil
import triaxcal.batch.local
assert triaxcal.batch.local.cores() > 0
import triaxcal.rig as room
for module in pkgutil.walk_packages(room.__path__, "triaxcal.rig."):
    importlib.import_module(module.name)
"""


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
