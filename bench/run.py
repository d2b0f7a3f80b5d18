"""Run benchmarks, print their figures, and write docs/performance.md.

    python bench/run.py                   # all, short: some minutes
    python bench/run.py series --full     # one of them, in full
    python bench/run.py --page            # all, and the page of the documentation

A benchmark is a file in bench/entries with an ENTRY. One that fails, or that needs what is not
installed, is reported; the others are run, and the exit code is 1.
"""

from __future__ import annotations

import argparse
import os
import sys
from importlib.util import find_spec
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from measuring import BENCHES, SIZES, Bench, Figure, cpu_s
from performance_page import PAGE, page, printed


def measured(bench: Bench, size: str) -> list[Figure] | str:
    """Its figures, or why it has none."""
    missing = [name for name in bench.packages if not find_spec(name)]
    if missing:
        return f"needs the package {', '.join(missing)}"
    try:
        return bench.measure(size)
    except KeyboardInterrupt:
        raise
    except Exception as fault:
        return f"{type(fault).__name__}: {' '.join(str(fault).split())}"


def main() -> int:
    """The exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(BENCHES.names))
    parser.add_argument("--full", action="store_true", help="as long as each is worth; some hours")
    parser.add_argument("--tiny", action="store_true", help="that each runs at all")
    parser.add_argument("--page", action="store_true", help="write docs/performance.md")
    given = parser.parse_args()
    unknown = [name for name in given.names if name not in BENCHES.names]
    if unknown:
        parser.error(f"no benchmark {', '.join(unknown)}; there are {', '.join(BENCHES.names)}")
    if given.page and (given.names or given.tiny):
        parser.error("the page is of one run of all benchmarks")
    size = SIZES[2] if given.full else SIZES[0] if given.tiny else SIZES[1]
    load = os.getloadavg()[0]
    found: dict[str, list[Figure] | str] = {}
    for bench in BENCHES:
        if given.names and bench.name not in given.names:
            continue
        before = cpu_s()
        found[bench.name] = measured(bench, size)
        print(printed(bench, found[bench.name], cpu_s() - before), flush=True)
    if given.page:
        PAGE.write_text(page(found, size, max(load, os.getloadavg()[0])), encoding="utf-8")
        print(PAGE)
    return int(any(isinstance(figures, str) for figures in found.values()))


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit("stopped; the same command begins again, a series goes on where it was")
