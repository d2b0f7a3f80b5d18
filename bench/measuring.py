"""What a benchmark is, and how it measures: processor time, alternately with what it is beside.

Processor seconds of this process and of its children that have ended: what else the machine does
disturbs them less than the clock. What is compared is measured in turn, and medians are compared.
"""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from triaxcal.base.registry import Registry

ROOT = Path(__file__).resolve().parents[1]
UNITS = ROOT / "units"
TESTS = ROOT / "tests"
SIZES = ("tiny", "short", "full")
ENVIRONMENT = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
"""With bytecode, as an installed package has it."""
T = TypeVar("T")


@dataclass(frozen=True)
class Kind:
    """A kind of figure, and how its ratio reads.

    Attributes
    ----------
    words : str
        Of the page's head.
    ratio : callable
        Of this program's value and the other's.
    """

    words: str
    ratio: Callable[[float, float], float]


KINDS = {
    "amount": Kind(
        "of seconds and bytes, the other's divided by this program's",
        lambda own, other: other / own,
    ),
    "rate": Kind(
        "of what is done in a minute, this program's divided by the other's",
        lambda own, other: own / other,
    ),
}
"""In both the other takes more where the ratio is above 1."""


@dataclass(frozen=True)
class Figure:
    """What was measured, and what stands beside it in the same unit.

    Attributes
    ----------
    what, unit : str
    value : float
    against : str
        What it is compared with, measured in the same run; "" where nothing is.
    other : float
        Its value.
    kind : str
        One of `KINDS`.
    """

    what: str
    value: float
    unit: str
    against: str = ""
    other: float = 0.0
    kind: str = "amount"

    @property
    def ratio(self) -> float | None:
        """How many times what this program takes the other takes."""
        if not (self.against and self.value and self.other):
            return None
        return KINDS[self.kind].ratio(self.value, self.other)


@dataclass(frozen=True)
class Bench:
    """One benchmark.

    Attributes
    ----------
    name, label, doc : str
        For the command, the heading and below it.
    measure : callable
        "tiny" (a test that it runs), "short" (seconds to a minute) or "full" -> figures.
    figures : tuple of str
        `what` of each figure that a short run gives.
    packages : tuple of str
        Modules that it needs and that not every installation has.
    sizes : str
        What differs between short and full, in words; "" where nothing does.
    rank : int
        Place in lists.
    """

    name: str
    label: str
    doc: str
    measure: Callable[[str], list[Figure]]
    figures: tuple[str, ...]
    packages: tuple[str, ...] = ()
    sizes: str = ""
    rank: int = 100


BENCHES: Registry[Bench] = Registry("benchmark", "entries", Bench, ("figures",))


def pick(size: str, tiny: T, short: T, full: T) -> T:
    """What belongs to a size."""
    return dict(zip(SIZES, (tiny, short, full), strict=True))[size]


def cpu_s() -> float:
    """Processor seconds so far, of ended children too."""
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + ended.ru_utime + ended.ru_stime


def spent(function: Callable[[], object]) -> float:
    """Processor seconds of a call."""
    before = cpu_s()
    function()
    return cpu_s() - before


def alternately(rounds: int, *functions: Callable[[], object]) -> list[float]:
    """Median processor seconds of each function, called in turn."""
    each = [[spent(function) for function in functions] for _ in range(rounds)]
    return [statistics.median(column) for column in zip(*each, strict=True)]


def run(command: Sequence[str | Path], folder: Path | str) -> None:
    """Run a command in a folder; what it prints is not shown."""
    subprocess.run(
        list(map(str, command)), check=True, cwd=folder, stdout=subprocess.DEVNULL, env=ENVIRONMENT
    )


def triaxcal(*arguments: str | Path) -> list[str | Path]:
    """The command line of this tree."""
    return [sys.executable, "-m", "triaxcal", *arguments]
