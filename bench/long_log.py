"""A log of many rows through `triaxcal poses`: rows, MB of the file, CPU seconds, peak memory.

The log is an exact sensor held in twelve poses in turn, at 1 kHz, as text of 40 bytes a row.

    python bench/long_log.py [--rows N]
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

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


def measured(folder: Path) -> tuple[float, float]:
    """CPU seconds and peak resident MB of `triaxcal poses` on a unit.

    Raises
    ------
    RuntimeError
        When the command fails.
    """
    command = [sys.executable, "-m", "triaxcal", "poses", str(folder)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"{' '.join(command)}: exit status {process.returncode}")
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rows", type=int, default=10_000_000)
    rows = max(parser.parse_args().rows // BLOCK, 1) * BLOCK
    with tempfile.TemporaryDirectory(prefix="triaxcal-") as scratch:
        folder = write_unit(Path(scratch) / "LONG", rows)
        size_mb = (folder / "log.csv").stat().st_size / 1e6
        cpu_s, peak_mb = measured(folder)
    print(f"rows {rows}, file {size_mb:.0f} MB, CPU {cpu_s:.1f} s, peak RSS {peak_mb:.0f} MB")


if __name__ == "__main__":
    main()
