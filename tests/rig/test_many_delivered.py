"""A chamber run of many units without a person, with faults: what is delivered, and what is not."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from many_cases import Run, bench_of, refuse_false_records, setup_of

from triaxcal.rig.many.replay import replay_bus
from triaxcal.rig.records.store import write_records

TEMPS = "[-40, -10, 20, 45, 70]"
SHARED = ("halt@150:1:20", "deaf@40:1:15", "runaway@330:3:60")
"""The table stops half way once, both instruments are silent for 15 s, the chamber goes too far."""


def run_of(folder: Path, count: int, dead: str, slipped: str) -> tuple[Run, int]:
    """A run in which one unit dies and one slips; and the second in which the first one died."""
    died = 650
    setup = setup_of(folder, count, TEMPS)
    orders = (*SHARED, f"{dead}/linkdown@{died}:1:99999", f"{slipped}/slip@100:150")
    bench = bench_of(setup, *orders, overshoot=0.05)
    run = Run(setup, bench, folder / "001", alone=True).go(limit_s=12_000)
    return run, died


def deliver(folder: Path, run: Run) -> subprocess.CompletedProcess[str]:
    """Records of the units that are done, each against its truth; `triaxcal batch` of them."""
    done = [m for m in run.group.members if not m.aside]
    for member in done:
        unit = member.place.setup.folder
        write_records(unit, member.session, member.place.setup.rig, {"sha256": ""})
        assert refuse_false_records(member.place, unit) == 30
    units = [str(m.place.setup.folder) for m in done]
    program = "from triaxcal.cli.entry import entry; entry()"
    return subprocess.run(
        [sys.executable, "-c", program, "batch", *units, "--build", str(folder / "build")],
        capture_output=True, text=True, check=False, env={**os.environ, "COLUMNS": "200"},
    )  # fmt: skip


def refuse_other_dwells(run: Run, folder: Path) -> None:
    """The logs alone give the same dwells again."""
    for bus in run.taken.setup.buses:
        names = [m.name for m in run.group.members if m.place.bus == bus and not m.aside]
        again, _ = replay_bus(run.taken.setup, folder / "001", bus, names)
        for member in run.group.members:
            if member.name in again:
                assert again[member.name].accepted == member.session.accepted


def check(folder: Path, count: int, dead: str, slipped: str) -> None:
    run, died = run_of(folder, count, dead, slipped)
    asides = {m.name: m.aside for m in run.group.members if m.aside}
    assert asides == {dead: "no readings for 60 s"}
    texts = [e.text for m, e in run.told if m.name == slipped and e.kind == "refused"]
    assert any(text.startswith("TP2: slip of 1") for text in texts), texts
    assert any("turned away and back" in text for _, text in run.done)
    assert any(e.kind == "left" for _, e in run.told)
    last = max(e.t_ns for m, e in run.told if m.name == dead)
    first = min(e.t_ns for _, e in run.told)
    assert last - first < died * 10**9
    done = deliver(folder, run)
    assert done.returncode == 0, done.stdout + done.stderr
    delivered = {path.parent.name for path in (folder / "build").glob("*/calibration.json")}
    assert delivered == {f"AT-{k}" for k in range(1, count + 1)} - {dead}
    assert not (folder / "units" / dead / "measurements.csv").exists()
    refuse_other_dwells(run, folder)


@pytest.mark.long
def test_three_units(tmp_path):
    check(tmp_path, 3, dead="AT-2", slipped="AT-3")


@pytest.mark.slow
def test_thirty_two_units_on_two_buses(tmp_path):
    check(tmp_path, 32, dead="AT-20", slipped="AT-9")
