"""Recordings that do not exist, by exact physics: poses held, turned between, with noise."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from triaxcal.model.types import FloatArray

K = np.array([[9.85, 0.03, -0.02], [0.01, 9.79, 0.05], [-0.04, 0.02, 9.90]])
"""(m/s^2)/g; not symmetric, as no sensor is."""
U0 = np.array([0.21, -0.33, 0.12])
RATE_HZ = 50.0


def directions(count: int, seed: int = 0) -> FloatArray:
    """Six faces first, then random directions, unit vectors (count, 3)."""
    faces = np.array([[0, 0, 1], [0, -1, 0], [0, 0, -1], [0, 1, 0], [-1, 0, 0], [1, 0, 0]], float)
    random = np.random.default_rng(seed).standard_normal((max(count - 6, 0), 3))
    random /= np.linalg.norm(random, axis=1, keepdims=True)
    return np.concatenate([faces, random])[:count]


def log(
    poses: FloatArray, hold_s: float | Sequence[float] = 3.0, sd: float = 0.02, seed: int = 1
) -> FloatArray:
    """Time and readings, shape (n, 4), m/s^2: each pose held, with a second of turning between."""
    random = np.random.default_rng(seed)
    holds = np.broadcast_to(np.asarray(hold_s, dtype=np.float64), len(poses))
    force = []
    for k, (pose, hold) in enumerate(zip(poses, holds, strict=True)):
        force.append(np.tile(pose, (round(hold * RATE_HZ), 1)))
        if k + 1 < len(poses):
            between = np.linspace(0.0, 1.0, round(RATE_HZ))[:, None]
            path = (1 - between) * pose + between * poses[k + 1]
            force.append(path + 0.3 * random.standard_normal(path.shape))
    a = np.concatenate(force)
    readings = a @ K.T + U0 + sd * random.standard_normal(a.shape)
    return np.column_stack([np.arange(len(a)) / RATE_HZ, readings])


UNIT = """format = 1
serial = "{name}"

[site]
local_gravity_m_per_s2 = 9.80665

{more}
[recording]
file = "log.csv"
{recording}
"""
COLUMNS = 'acceleration = ["ax", "ay", "az"]\nacceleration_unit = "m/s^2"\ntime = "t"'


def write_unit(
    folder: Path,
    rows: FloatArray | str,
    recording: str = COLUMNS,
    *,
    more: str = "",
    header: str = "t,ax,ay,az",
) -> Path:
    """A unit's folder with its recording."""
    folder.mkdir(parents=True, exist_ok=True)
    text = rows if isinstance(rows, str) else csv_text(rows, header)
    text += "\n" * (not text.endswith("\n"))
    (folder / "log.csv").write_text(text, encoding="utf-8")
    toml = UNIT.format(name=folder.name, more=more, recording=recording)
    (folder / "unit.toml").write_text(toml, encoding="utf-8")
    return folder


def csv_text(rows: FloatArray, header: str) -> str:
    """Rows as CSV with nine digits."""
    lines = [",".join(f"{value:.9g}" for value in row) for row in rows]
    return "\n".join([header, *lines]) + "\n"
