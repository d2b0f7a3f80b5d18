"""A figure of a test report, with its 95 % interval and how it was measured, or why it was not."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from scipy.special import gammaincinv

from triaxcal.model.types import FloatArray
from triaxcal.uncertainty.coverage import coverage_factor


@dataclass(frozen=True)
class Figure:
    """One figure.

    Attributes
    ----------
    key : str
        For machines.
    name : str
    axis : str
        "x", "y", "z", two of them as "xy" (output x, acceleration along y), or "" of the unit.
    unit : str
    value : float or None
        None where it is not measured, or only a limit is known.
    low, high : float or None
        95 % interval; `low` None where `high` is a limit for its size; both None where the value is
        a finding without an interval.
    how : str
        How it was measured.
    why : str
        Why it was not measured; "" of one that was.
    """

    key: str
    name: str
    axis: str
    unit: str
    value: float | None = None
    low: float | None = None
    high: float | None = None
    how: str = ""
    why: str = ""

    @property
    def measured(self) -> bool:
        """Whether anything is known of it."""
        return not self.why

    @property
    def expanded(self) -> float | None:
        """Half of an interval about the value; None of a one-sided or unequal one."""
        if self.value is None or self.low is None or self.high is None:
            return None
        above, below = self.high - self.value, self.value - self.low
        return above if math.isclose(above, below, rel_tol=1e-6, abs_tol=1e-30) else None

    def covers(self, truth: float) -> bool:
        """Whether the interval holds a value; of a limit, whether its size does."""
        if self.high is None:
            return False
        return abs(truth) <= self.high if self.low is None else self.low <= truth <= self.high


@dataclass(frozen=True)
class Curve:
    """A curve of a chapter's picture; `dashed` of a model."""

    label: str
    axis: int
    x: FloatArray
    y: FloatArray
    dashed: bool = False


@dataclass(frozen=True)
class Drawing:
    """A picture of a chapter: curves over a common axis; `powers` of both axes on powers of ten."""

    title: str
    x_label: str
    curves: tuple[Curve, ...]
    powers: bool = False


@dataclass(frozen=True)
class Chapter:
    """A chapter of the report.

    Attributes
    ----------
    key, title, definition : str
        `definition` says what the figures are, for a reader.
    figures : tuple of Figure
    notes : tuple of str
        What the reader should know of the recordings.
    drawings : tuple of Drawing
    """

    key: str
    title: str
    definition: str
    figures: tuple[Figure, ...]
    notes: tuple[str, ...] = ()
    drawings: tuple[Drawing, ...] = field(default=(), repr=False)


def with_expanded(figure: Figure, value: float, expanded: float) -> Figure:
    """The figure with a value and the half-width of its interval."""
    return Figure(
        figure.key, figure.name, figure.axis, figure.unit, value, value - expanded,
        value + expanded, figure.how,
    )  # fmt: skip


def by_key(figures: Iterable[Figure]) -> tuple[Figure, ...]:
    """Figures of one key together, keys in the order in which they first appear."""
    groups: dict[str, list[Figure]] = {}
    for figure in figures:
        groups.setdefault(figure.key, []).append(figure)
    return tuple(f for members in groups.values() for f in members)


def mean_of_runs(values: FloatArray, sds: FloatArray) -> tuple[float, float]:
    """Mean of runs (n,) and its expanded uncertainty.

    With four runs and more by their own scatter, Student with n - 1 degrees of freedom; with fewer
    by the standard deviations `sds` of each; runs are weighted by them unless one is 0.
    """
    n = len(values)
    if n >= 4:
        sd = float(np.std(values, ddof=1)) / math.sqrt(n)
        return float(values.mean()), coverage_factor(n - 1.0) * sd
    if not sds.all():
        return float(values.mean()), 1.96 * math.sqrt(float(sds @ sds)) / n
    weight = 1.0 / sds**2
    mean = float(weight @ values / weight.sum())
    return mean, 1.96 / math.sqrt(float(weight.sum()))


def sd_interval(sd: float, dof: float) -> tuple[float, float]:
    """95 % interval of a standard deviation that is known with `dof` degrees of freedom."""
    high, low = 2.0 * gammaincinv(dof / 2.0, [0.975, 0.025])  # chi^2
    return sd * math.sqrt(dof / high), sd * math.sqrt(dof / low)
