"""Units turned by hand whose biases flicker, against their truth: coverage of 95 % intervals.

The simulation is that of tests/hand_motion.py: poses of 2 to 4.5 s for 3 min, bias instability of
1.6 deg/h and 12 micro-g, shaped in the frequency domain or summed of Gauss-Markov processes. Some
four seconds of CPU a seed.

    python bench/flicker_seeds.py [stated|white|absent] [shaped|summed] [first] [seeds]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from hand_motion import HandNoise, hand_recording, shaped_flicker, summed_flicker
from triaxcal.dynamic.calibrate import calibrate_dynamic
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.wander import FLOOR

GYRO, ACCEL = 1.6, 12.0
UNIT = HandNoise(gyro_b=GYRO / FLOOR, accel_b=ACCEL / FLOOR)
WHITE = DataSheet(UNIT.gyro_n, UNIT.accel_n, accel_lsb=UNIT.accel_lsb)
SHEETS = {
    "stated": DataSheet(
        UNIT.gyro_n,
        UNIT.accel_n,
        accel_lsb=UNIT.accel_lsb,
        gyro_bias_instability_deg_per_h=GYRO,
        accel_bias_instability_ug=ACCEL,
    ),
    "white": WHITE,
    "absent": DataSheet(),
}
FLICKER = {"shaped": shaped_flicker, "summed": summed_flicker}


def main() -> None:
    told = sys.argv[1] if len(sys.argv) > 1 else "stated"
    kind = sys.argv[2] if len(sys.argv) > 2 else "summed"
    first = int(sys.argv[3]) if len(sys.argv) > 3 else 0
    count = int(sys.argv[4]) if len(sys.argv) > 4 else 12
    z, weighted = [], []
    for seed in range(first, first + count):
        true, recording = hand_recording(seed, UNIT, flicker=FLICKER[kind])
        result = calibrate_dynamic(recording, SHEETS[told])
        names = [state.name for state in result.layout.states]
        known = [i for i, name in enumerate(names) if name in true]
        error = result.p[known] - np.array([true[names[i]] for i in known])
        covariance = result.covariance[np.ix_(known, known)]
        z.append(error / result.sd[known])
        weighted.append(float(error @ np.linalg.solve(covariance, error)))
        print(f"seed {seed}: {weighted[-1]:.1f} of {len(known)}", flush=True)
    all_z = np.array(z)
    each = " ".join(
        f"{names[i]} {value:.1f}" for i, value in zip(known, (all_z**2).sum(0), strict=True)
    )
    print(
        f"{count} seeds, {kind}, noise {told}: {100 * (np.abs(all_z) < 1.96).mean():.1f} % of "
        f"{all_z.size} within 95 %, weighted squares {np.mean(weighted):.1f} of {len(known)}, "
        f"largest {np.abs(all_z).max():.1f} sd\nchi-square of each constant: {each}"
    )


if __name__ == "__main__":
    main()
