"""A calibration from poses of |a| = g, and what it costs to begin with."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from measuring import TESTS, Bench, Figure, alternately, pick, run, triaxcal

sys.path.insert(0, str(TESTS / "family"))

from family_cases import write_unit

_ROWS = 'rows = "poses"\nacceleration = [1, 2, 3]\nacceleration_unit = "m/s^2"'


def measure(size: str) -> list[Figure]:
    count = pick(size, 50, 2000, 2000)
    random = np.random.default_rng(0)
    poses = random.standard_normal((count, 3))
    poses *= 9.80665 / np.linalg.norm(poses, axis=1, keepdims=True)
    poses += 3e-3 * random.standard_normal(poses.shape)
    with tempfile.TemporaryDirectory() as folder:
        unit = write_unit(Path(folder) / "POSES", poses, _ROWS, header="a,b,c")
        whole, start = alternately(
            pick(size, 1, 3, 5),
            lambda: run(triaxcal("calib", unit), folder),
            lambda: run([sys.executable, "-c", "import numpy, scipy.optimize, jinja2"], folder),
        )
    what = _POSES if count == 2000 else f"`triaxcal calib` on {count} poses"
    return [Figure(what, whole, "CPU s", "Python with numpy, scipy and jinja2 imported", start)]


_POSES = "`triaxcal calib` on 2000 poses"
ENTRY = Bench(
    name="poses",
    label="A calibration from poses",
    doc="Fit with priors, held-out poses, proof, cross-check and passport.",
    measure=measure,
    figures=(_POSES,),
    rank=31,
)
