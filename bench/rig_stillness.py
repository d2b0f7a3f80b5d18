"""What the stillness detectors find and miss, over seeded dwells.

python bench/rig_stillness.py [dwells]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "rig"))

from still_cases import SETTINGS, creep, reference, seconds, slip, verdict

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


def main() -> None:
    print(f"{DWELLS} dwells of white noise, 20 micro-g per root hertz at 100 Hz")
    print(f"false alarms                        {share(None):6.2f} %")
    for size in (15.0, 20.0, 30.0, 40.0):
        found = share(lambda rng, size=size: slip(rng, size))
        print(f"slip of {size:3.0f} micro-g found           {found:6.2f} %")
    for size, tau in ((20.0, 20.0), (100.0, 20.0), (100.0, 60.0), (200.0, 30.0)):
        added = creep(size, tau)
        found = share(lambda _, added=added: added)
        print(
            f"creep of {size:3.0f} micro-g, {tau:2.0f} s found     {found:6.2f} %"
            f"   it moves the mean by {moved_mean(added):.1f} micro-g"
        )


main()
