"""Cross-coupling of an orthogonal pair on a dividing head, from a file or position by position."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from triaxcal.api.study import Study
from triaxcal.base.arrays import finite
from triaxcal.base.errors import RefusedError
from triaxcal.fitting.pair.checks import odd_reading
from triaxcal.fitting.pair.cross_coupling import PairFit, fit_pair
from triaxcal.fitting.pair.model import OUTPUT, PENDULUM
from triaxcal.fitting.pair.recursion import PairEstimate, PairFilter, recursive_pair
from triaxcal.model.types import FloatArray
from triaxcal.readings.pair import read_pair
from triaxcal.report import pair
from triaxcal.unit.site import STANDARD_GRAVITY_M_PER_S2

MOUNTINGS = (PENDULUM, OUTPUT)


def cross_coupling(
    file: str | Path,
    gravity_m_per_s2: float = STANDARD_GRAVITY_M_PER_S2,
    mounting: str = PENDULUM,
    *,
    cubic: bool = True,
) -> Study[PairFit]:
    """Cross-coupling of an orthogonal pair of accelerometers on a dividing head.

    Parameters
    ----------
    file : path
        CSV with columns theta_deg, a_g, b_g, one row for each position; and sd_a_g, sd_b_g where
        the standard deviations of the readings are known.
    gravity_m_per_s2 : float
    mounting : str
        "pendulum": the pendulum axes lie in the plane of rotation, and Kip is measured. "output":
        the output axes do, and Kio is.
    cubic : bool
        Whether K3 of both together is fitted.

    Raises
    ------
    RefusedError
        When the file cannot be read, or its positions do not determine the coefficients.
    """
    read = read_pair(Path(file))
    gravity_g = gravity_m_per_s2 / STANDARD_GRAVITY_M_PER_S2
    head = _Head(gravity_g, mounting, cubic)
    return _study(str(file), (read.theta_rad, read.a_g, read.b_g), read.sd_g, head)


@dataclass(frozen=True)
class _Head:
    """How a pair is measured and fitted."""

    gravity_g: float
    mounting: str
    cubic: bool

    def __post_init__(self) -> None:
        if self.mounting not in MOUNTINGS:
            raise RefusedError("mounting", f'"{self.mounting}"', expected=" or ".join(MOUNTINGS))


def _study(
    source: str,
    readings: tuple[FloatArray, FloatArray, FloatArray],
    sd_g: FloatArray | None,
    head: _Head,
) -> Study[PairFit]:
    fit = fit_pair(source, *readings, head.gravity_g, sd_g=sd_g, cubic=head.cubic)
    recursion = recursive_pair(*readings, head.gravity_g, sd_g, cubic=head.cubic)
    return Study(
        fit,
        pair.pair_text(fit, recursion, head.mounting),
        lambda: pair.pair_picture(recursion, head.mounting),
    )


class LivePair:
    """The same at the dividing head: the estimate after each position.

        pair = triaxcal.LivePair()
        estimate = pair.take(5.0, -0.99614, 0.08721)
        print(pair.summary)

    Attributes
    ----------
    summary : str
        The last position in one line, and whether there are enough of them.
    """

    def __init__(
        self,
        gravity_m_per_s2: float = STANDARD_GRAVITY_M_PER_S2,
        mounting: str = PENDULUM,
        target_g_per_g2: float | None = None,
        *,
        cubic: bool = True,
    ) -> None:
        """`target_g_per_g2`: standard deviation of both cross-couplings that is wanted."""
        self._head = _Head(gravity_m_per_s2 / STANDARD_GRAVITY_M_PER_S2, mounting, cubic)
        self._target = target_g_per_g2
        self._rows: list[tuple[float, ...]] = []
        self._filter = self._fresh()
        self.summary = ""

    def _fresh(self) -> PairFilter:
        return PairFilter(self._head.gravity_g, cubic=self._head.cubic)

    @property
    def rows(self) -> tuple[tuple[float, ...], ...]:
        """Positions taken: theta_deg, a_g, b_g, and the two standard deviations if given."""
        return tuple(self._rows)

    def take(self, theta_deg: float, a_g: float, b_g: float, *sd_g: float) -> PairEstimate:
        """Take a position; `sd_g` are the standard deviations of A and B, where they are known.

        Raises
        ------
        RefusedError
            When the readings are in another unit, of other axes, or not numbers; the position is
            then not taken.
        """
        for name, value in (("theta_deg", theta_deg), ("a_g", a_g), ("b_g", b_g)):
            finite(name, value)
        odd = odd_reading(np.radians(theta_deg), a_g, b_g, self._head.gravity_g)
        place = f"position {len(self._rows) + 1}"
        if odd:
            raise RefusedError(
                place, odd, remedy="check angle, columns, signs and unit; type again"
            )
        if sd_g and (len(sd_g) != 2 or not all(0.0 < v < math.inf for v in sd_g)):
            raise RefusedError(
                place, "sd " + ", ".join(f"{v:g}" for v in sd_g), expected="two numbers above 0"
            )
        if self._rows and bool(sd_g) != (len(self._rows[0]) == 5):
            raise RefusedError(
                place,
                "with standard deviations" if sd_g else "without standard deviations",
                expected="as the positions before: with them in all positions, or in none",
                remedy="type the position again",
            )
        self._rows.append((theta_deg, a_g, b_g, *sd_g))
        return self._estimate(self._rows[-1])

    def undo(self) -> PairEstimate | None:
        """Take the last position back; the estimate of those that are left, None without any."""
        self._rows = self._rows[:-1]
        self._filter, self.summary = self._fresh(), ""
        estimate = None
        for row in self._rows:
            estimate = self._estimate(row)
        return estimate

    def study(self) -> Study[PairFit]:
        """All positions at once, as `cross_coupling`.

        Raises
        ------
        RefusedError
            As `cross_coupling`.
        """
        columns = np.array([row[:3] for row in self._rows]).reshape(-1, 3)
        stated = bool(self._rows) and all(len(row) == 5 for row in self._rows)
        sd = np.array([row[3:] for row in self._rows]) if stated else None
        readings = (np.radians(columns[:, 0]), columns[:, 1].copy(), columns[:, 2].copy())
        return _study("the positions", readings, sd, self._head)

    def _estimate(self, row: tuple[float, ...]) -> PairEstimate:
        sd = (row[3], row[4]) if len(row) == 5 else None
        estimate = self._filter.take(float(np.radians(row[0])), row[1], row[2], sd)
        self.summary = pair.live_text(estimate, self._head.mounting, self._target)
        return estimate
