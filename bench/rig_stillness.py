"""What the stillness detectors find and miss, over seeded dwells.

python bench/rig_stillness.py [dwells]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "rig"))

from still_cases import SETTINGS, creep, reference, seconds, slip, verdict

from triaxcal.rig.plan.plan import Thermal
from triaxcal.rig.session.equilibrium import trend, window_s

DWELLS = int(sys.argv[1]) if len(sys.argv) > 1 else 1000


def share(disturb) -> float:
    rng = np.random.default_rng(1)
    refused = 0
    for i in range(DWELLS):
        if i % 20 == 0:
            ref = reference(1000 + i)
        refused += bool(verdict(rng, ref, disturb(rng) if disturb else None))
    return 100.0 * refused / DWELLS


def moved_mean(added) -> float:
    """By how much a disturbance moves the mean that would be accepted."""
    inside = (seconds() >= 0) & (seconds() < SETTINGS.average_s)
    return abs(added[inside].mean() - added[-1])


def rests(seed, slope_k_per_min, amplitude_k, stated_s, cycle_s=120.0) -> bool:
    """Whether a unit's temperature that drifts and cycles passes for rest."""
    rng = np.random.default_rng(seed)
    settings = Thermal(cycle_s=stated_s)
    t = np.arange(float(window_s(settings)))
    cycle = amplitude_k * np.sin(2 * np.pi * t / cycle_s + rng.uniform(0.0, 2 * np.pi))
    readings = cycle + slope_k_per_min * t / 60 + 0.01 / 10**0.5 * rng.standard_normal(len(t))
    return trend(t, 20.0 + readings, settings).rests(settings)


def equilibrium() -> None:
    limit = Thermal().slope_max_k_per_min
    print(f"temperature: windows that pass for rest, limit {limit:g} K/min, cycles of 120 s")
    for slope, amplitude, stated in (
        (0.0, 0.0, 0), (0.021, 0.0, 0), (0.05, 0.0, 0), (0.0, 0.15, 0), (0.0, 0.15, 120),
        (0.0, 0.15, 115), (0.021, 0.15, 120), (0.05, 0.15, 120),
    ):  # fmt: skip
        passed = [rests(seed, slope, amplitude, stated) for seed in range(DWELLS)]
        said = f"stated as {stated} s" if stated else "not stated"
        print(
            f"drift {slope:5.3f} K/min, cycle +-{amplitude:4.2f} K {said:15}"
            f"{100.0 * np.mean(passed):6.1f} %"
        )


def main() -> None:
    print(f"{DWELLS} dwells of white noise, 20 micro-g per root hertz at 100 Hz")
    print(f"false alarms                        {share(None):6.2f} %")
    for size in (15.0, 20.0, 30.0, 40.0):
        found = share(lambda rng, size=size: slip(rng, size))
        print(f"slip of {size:3.0f} micro-g found           {found:6.2f} %")
    for size, tau in ((20.0, 20.0), (30.0, 20.0), (20.0, 10.0), (20.0, 40.0), (100.0, 60.0)):
        added = creep(size, tau)
        found = share(lambda _, added=added: added)
        print(
            f"creep of {size:3.0f} micro-g, {tau:2.0f} s found     {found:6.2f} %"
            f"   it moves the mean by {moved_mean(added):.1f} micro-g"
        )
    equilibrium()


main()
