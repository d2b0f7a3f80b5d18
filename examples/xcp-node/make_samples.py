"""Writes samples.bin: 64 samples of a unit at rest with z up, as its sensor would give them.

    python make_samples.py build/AT-SIM/calibration.json 9.8111 samples.bin

9.8111 is local_gravity_m_per_s2 of the unit's unit.toml. Each row is four int32, little-endian: the
temperature code, and the raw codes x, y, z.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import triaxcal

ROWS = 64
NOISE_CODES = 2


def main(calibration: str, gravity_m_per_s2: str, samples: str) -> None:
    """Solve the compensation for the codes that give local gravity along z."""
    firmware = triaxcal.firmware(triaxcal.load(calibration))
    plan = firmware.plan
    temp_code = (plan.temp_min_code + plan.temp_max_code) // 2
    # The compensation is affine in the raw codes: four points give it.
    step = 1 << 14
    tried = np.vstack([np.zeros(3), np.eye(3) * step]).astype(np.int32)
    accel = np.asarray(firmware.apply(tried, temp_code)[0], np.float64)
    slopes = (accel[1:] - accel[0]).T / step
    wanted = np.array([0.0, 0.0, float(gravity_m_per_s2) / 9.80665]) * 2.0**plan.shape.output_q
    raw = np.rint(np.linalg.solve(slopes, wanted - accel[0]))
    noise = np.random.default_rng(1).integers(-NOISE_CODES, NOISE_CODES + 1, (ROWS, 3))
    rows = np.column_stack([np.full(ROWS, temp_code), raw + noise]).astype("<i4")
    Path(samples).write_bytes(rows.tobytes())


if __name__ == "__main__":
    main(*sys.argv[1:])
