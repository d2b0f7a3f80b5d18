"""Units turned by hand whose biases flicker, against their truth: coverage of 95 % intervals.

The simulation is that of tests/hand_motion.py: poses of 2 to 4.5 s for 3 min, white noise of
0.119 deg/sqrt(h) and 49.5 micro-g/sqrt(Hz). Its flicker is shaped in the frequency domain or summed
of Gauss-Markov processes, and has the Allan deviation of the white noise at `meet_s` seconds; 0 is
none. Some two seconds of CPU a seed.

    python bench/flicker_seeds.py [stated|white|absent] [shaped|summed] [first] [seeds] [meet_s]
"""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from hand_motion import HandNoise, hand_recording, shaped_flicker, summed_flicker
from triaxcal.dynamic.calibrate import calibrate_dynamic
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.wander import FLOOR

WHITE = HandNoise()
MEET_S = 20.0


def unit_and_sheet(noise: str, meet_s: float) -> tuple[HandNoise, DataSheet]:
    """The unit, and what is stated of its noise."""
    root = math.sqrt(meet_s) if meet_s else math.inf
    gyro, accel = WHITE.gyro_n * 60 / root, WHITE.accel_n / root
    unit = HandNoise(gyro_b=gyro / FLOOR, accel_b=accel / FLOOR)
    white = DataSheet(unit.gyro_n, unit.accel_n, accel_lsb=unit.accel_lsb)
    stated = replace(white, gyro_bias_instability_deg_per_h=gyro, accel_bias_instability_ug=accel)
    return unit, {"stated": stated, "white": white, "absent": DataSheet()}[noise]


FLICKER = {"shaped": shaped_flicker, "summed": summed_flicker}


def main() -> None:
    noise = sys.argv[1] if len(sys.argv) > 1 else "stated"
    kind = sys.argv[2] if len(sys.argv) > 2 else "summed"
    first = int(sys.argv[3]) if len(sys.argv) > 3 else 0
    count = int(sys.argv[4]) if len(sys.argv) > 4 else 12
    meet_s = float(sys.argv[5]) if len(sys.argv) > 5 else MEET_S
    unit, sheet = unit_and_sheet(noise, meet_s)
    z, weighted, found = [], [], []
    for seed in range(first, first + count):
        true, recording = hand_recording(seed, unit, flicker=FLICKER[kind])
        result = calibrate_dynamic(recording, sheet)
        names = [state.name for state in result.layout.states]
        known = [i for i, name in enumerate(names) if name in true]
        error = result.p[known] - np.array([true[names[i]] for i in known])
        covariance = result.covariance[np.ix_(known, known)]
        z.append(error / result.sd[known])
        weighted.append(float(error @ np.linalg.solve(covariance, error)))
        used = result.noise
        found.append((used.gyro_bias_instability_deg_per_h, used.accel_bias_instability_ug))
        print(f"seed {seed}: {weighted[-1]:.1f} of {len(known)}", flush=True)
    all_z = np.array(z)
    medians = np.median(found, axis=0)
    each = " ".join(
        f"{names[i]} {value:.1f}" for i, value in zip(known, (all_z**2).sum(0), strict=True)
    )
    print(
        f"{count} seeds, {kind}, noise {noise}: {100 * (np.abs(all_z) < 1.96).mean():.1f} % of "
        f"{all_z.size} within 95 %, weighted squares {np.mean(weighted):.1f} of {len(known)}, "
        f"largest {np.abs(all_z).max():.1f} sd\nchi-square of each constant: {each}\n"
        f"bias instability: gyros {unit.gyro_b * FLOOR:.2f} deg/h, found {medians[0]:.2f}; "
        f"accelerometers {unit.accel_b * FLOOR:.1f} micro-g, found {medians[1]:.1f} (medians)"
    )


if __name__ == "__main__":
    main()
