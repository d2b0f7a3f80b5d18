"""How often stated 95 % intervals hold the truth: `python bench/coverage.py --help`.

Devices of tests/coverage_devices.py: those drawn from the default priors, by the number of poses,
with squares and without (and without, where [priors] does not say so); then devices far from the
priors in one thing. A line is written for each: shares in percent, of scale factors, cross terms,
biases and own squares, of the components and the length of the delivered acceleration at random
orientations, and of the length by the integers of the C.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

from coverage_devices import FAR, KINDS, Shares, shares

POSES = (6, 8, 12, 24, 40)


def line(name: str, count: int, found: Shares, seconds: float) -> str:
    """One row of the table."""
    cells = "".join(
        f"{100 * found[kind]:11.1f}" if kind in found else "          -" for kind in KINDS
    )
    return f"{name:28s}{count:6d}{cells}{1e3 * seconds:7.0f}"


def main() -> None:
    """Write the lines."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--devices", type=int, default=100, help="of each line")
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    parser.add_argument("--poses", type=int, nargs="+", default=POSES)
    parser.add_argument("--far", choices=[*FAR, "all", "none"], nargs="+", default=["all"])
    given = parser.parse_args()
    print(f"{'devices':28s}{'poses':>6s}{''.join(f'{kind:>11s}' for kind in KINDS)}     ms")
    rows: list[tuple[str, dict[str, object]]] = [
        ("drawn, squares", {"squares": True}),
        ("drawn, no squares", {"squares": False}),
        ("the same, not stated", {"squares": False, "stated": ""}),
    ]
    far = FAR if "all" in given.far else [name for name in given.far if name != "none"]
    rows += [(name, {"squares": True, "far": name}) for name in far]
    for name, kind in rows:
        for count in given.poses:
            started = time.process_time()
            seeds = range(given.first, given.first + given.devices)
            found = shares([1000 * count + k for k in seeds], count, **kind)
            print(
                line(name, count, found, (time.process_time() - started) / given.devices),
                flush=True,
            )


if __name__ == "__main__":
    main()
