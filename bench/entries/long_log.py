"""A log of many rows through `triaxcal poses`: processor time and peak memory."""

from __future__ import annotations

import os
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from measuring import Bench, Figure, pick, spent, triaxcal

UNIT = """format = 1
serial = "LONG"
[site]
local_gravity_m_per_s2 = 9.80665
[recording]
file = "log.csv"
acceleration = ["ax", "ay", "az"]
acceleration_unit = "g"
time = "t"
"""
RATE_HZ = 1000.0
BLOCK = 100_000
"""Rows written at once, and of a pose with the turning before it."""
TURNING = 2000
"""Rows of it in which the sensor turns."""


def write_unit(folder: Path, rows: int) -> Path:
    """A unit's folder with a log of `rows` rows, a whole number of blocks."""
    folder.mkdir(parents=True)
    (folder / "unit.toml").write_text(UNIT, encoding="utf-8")
    random = np.random.default_rng(1)
    directions = random.standard_normal((12, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    before = directions[-1]
    with (folder / "log.csv").open("w", encoding="utf-8") as file:
        file.write("t,ax,ay,az\n")
        for k in range(rows // BLOCK):
            pose = directions[k % 12]
            share = np.minimum(np.arange(BLOCK) / TURNING, 1.0)[:, None]
            force = (1 - share) * before + share * pose + 0.001 * random.standard_normal((BLOCK, 3))
            force += 0.3 * random.standard_normal((BLOCK, 3)) * (share < 1.0)
            time = (k * BLOCK + np.arange(BLOCK))[:, None] / RATE_HZ
            np.savetxt(file, np.hstack([time, force]), "%.3f,%.6f,%.6f,%.6f")
            before = pose
    return folder


def measure(size: str) -> list[Figure]:
    rows = pick(size, 100_000, 1_000_000, 10_000_000)
    peer_rows = min(rows, 1_000_000)
    with tempfile.TemporaryDirectory(prefix="triaxcal-") as scratch:
        folder = write_unit(Path(scratch) / "LONG", rows)
        size_mb = (folder / "log.csv").stat().st_size / 1e6
        cpu_s, peak_mb = measured(folder)
        loaded = spent(
            lambda: np.loadtxt(folder / "log.csv", delimiter=",", skiprows=1, max_rows=peer_rows)
        )
    million = 1e6 / rows
    return [
        Figure(_CPU, cpu_s * million, "s", _PEER, loaded * 1e6 / peer_rows),
        Figure(_MEMORY, peak_mb, "MB", "the file itself", size_mb),
    ]


def measured(folder: Path) -> tuple[float, float]:
    """CPU seconds and peak resident MB of `triaxcal poses` on a unit.

    Raises
    ------
    RuntimeError
        When the command fails.
    """
    command = triaxcal("poses", folder)
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"triaxcal poses {folder}: exit status {process.returncode}")
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


_CPU = "`triaxcal poses` on a log, for a million rows"
_PEER = "numpy.loadtxt on the same file, for a million rows"
_MEMORY = "its memory"
ENTRY = Bench(
    name="long_log",
    label="A long log",
    doc="A sensor at 1 kHz held in twelve poses in turn, as text of 40 bytes a row: read, checked, "
    "and its rests found.",
    measure=measure,
    figures=(_CPU, _MEMORY),
    sizes="1 million rows, 10 million with --full",
    rank=40,
)
