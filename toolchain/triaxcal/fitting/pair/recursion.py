"""The pair position after position, P3 (12): an estimate that can be read at the dividing head."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.fitting.pair.model import KIP, NAMES, design, half_square, half_square_sd
from triaxcal.model.types import FloatArray

DOF_MIN = 5
"""The noise is known to a third of itself, 1 / sqrt(2 dof), before an estimate is called enough."""
SPREAD_MAX = 2.0
"""Standard deviation of Kip against that of as many positions spread over the full turn."""
SURPRISE = 5.0
"""Standard deviations: a position further from what the others predict is worth a second look."""
_FULL = 360


@dataclass(frozen=True)
class PairEstimate:
    """What the positions taken so far say.

    Attributes
    ----------
    count : int
        Positions.
    values, sd : arrays, shape (8,), or None
        In the order of `NAMES`; None before the positions determine them, and `sd` before there is
        a residual to see the noise by, unless it is stated.
    noise : float
        Of Z, g^2; of its stated standard deviations where there are some. NaN when unknown.
    spread : float
        sd of Kip against that of as many positions spread over the full turn.
    unknowns : int
        Coefficients that are fitted: 8, or 7 without K3.
    surprise : float
        How far the last Z is from what the others predict, in standard deviations; NaN at first.
    """

    count: int
    values: FloatArray | None
    sd: FloatArray | None
    noise: float
    spread: float
    surprise: float
    unknowns: int

    @property
    def dof(self) -> int:
        """Degrees of freedom of the residuals."""
        return self.count - self.unknowns

    def enough(self, target: float | None = None) -> bool:
        """Whether both Kip are known well enough: to `target`, g/g^2, if there is one.

        Without it, when more positions help by their number alone: they are spread over the turn,
        and the noise is known.
        """
        if self.sd is None or self.dof < DOF_MIN:
            return False
        if target is not None:
            return bool(self.sd[KIP].max() <= target)
        return self.spread <= SPREAD_MAX


class PairFilter:
    """The Markov estimate of (12), in square-root information form.

    Its covariance form needs a start that a guess would bias. The triangle R of R X = d needs none,
    and gives the batch solution to rounding. Nothing but a triangle of nine, or eight, is kept.
    """

    def __init__(self, gravity_g: float, *, cubic: bool = True) -> None:
        self.gravity_g, self.cubic = gravity_g, cubic
        self.unknowns = len(NAMES) - (not cubic)
        self._triangle = np.zeros((self.unknowns + 1, self.unknowns + 1))
        self._information = np.zeros((self.unknowns, self.unknowns))
        self._count = 0
        self._stated = True

    def take(
        self, theta_rad: float, a_g: float, b_g: float, sd_g: tuple[float, float] | None = None
    ) -> PairEstimate:
        """Take a position; `sd_g` are the standard deviations of A and B, where they are known."""
        theta, a, b = np.array([theta_rad]), np.array([a_g]), np.array([b_g])
        H, z = (
            design(theta, self.gravity_g, cubic=self.cubic)[0],
            half_square(a, b, self.gravity_g)[0],
        )
        root = 1.0 if sd_g is None else float(half_square_sd(a, b, np.array([sd_g]))[0])
        self._stated = self._stated and sd_g is not None
        surprise = self._surprise(H / root, z / root)
        row = np.append(H, z)[None] / root
        self._triangle = np.asarray(np.linalg.qr(np.concatenate([self._triangle, row]), mode="r"))
        self._information += np.outer(H, H)
        self._count += 1
        return self._estimate(surprise)

    def triangle(self) -> tuple[FloatArray, FloatArray]:
        """R and d of R X = d."""
        n = self.unknowns
        return self._triangle[:n, :n], self._triangle[:n, n]

    def _known(self) -> bool:
        R, _ = self.triangle()
        small = np.abs(np.diag(R)).min()
        return self._count >= self.unknowns and bool(small > 1e-9 * np.abs(R).max())

    def _noise(self) -> float:
        """Rms residual per degree of freedom, over the stated sd where there are some."""
        dof = self._count - self.unknowns
        found = abs(float(self._triangle[-1, -1])) / np.sqrt(dof) if dof > 0 else float("nan")
        if not self._stated:
            return found
        return believed(found, dof) if dof > 0 else 1.0

    def _surprise(self, H: FloatArray, z: float) -> float:
        noise = self._noise()
        if not self._known() or not noise > 0.0:
            return float("nan")
        R, d = self.triangle()
        away = float(z - H @ np.linalg.solve(R, d))
        spread = np.linalg.norm(np.linalg.solve(R.T, H))
        return abs(away) / (noise * float(np.hypot(1.0, spread)))

    def _estimate(self, surprise: float) -> PairEstimate:
        if not self._known():
            return PairEstimate(
                self._count, None, None, float("nan"), float("inf"), surprise, self.unknowns
            )
        R, d = self.triangle()
        noise = self._noise()
        sd = noise * np.linalg.norm(np.linalg.inv(R), axis=1)
        own = np.sqrt(np.diag(np.linalg.inv(self._information))[KIP]).max()
        ideal = full_turn_sd(self.gravity_g) / np.sqrt(self._count)
        return PairEstimate(
            count=self._count,
            values=np.linalg.solve(R, d).astype(np.float64),
            sd=sd.astype(np.float64) if np.isfinite(noise) else None,
            noise=noise,
            spread=float(own / ideal),
            surprise=surprise,
            unknowns=self.unknowns,
        )


def believed(found: float, dof: int) -> float:
    """Factor on stated standard deviations: 1, unless the residuals exceed them significantly."""
    # chi-square over dof has a standard deviation of sqrt(2 / dof).
    return found if found**2 > 1.0 + 3.0 * np.sqrt(2.0 / dof) else 1.0


def full_turn_sd(gravity_g: float) -> float:
    """sd of Kip by one of many positions spread over the full turn, for a noise of Z of 1 g^2."""
    H = design(np.radians(np.arange(_FULL, dtype=np.float64)), gravity_g)
    return float(np.sqrt(_FULL * np.diag(np.linalg.inv(H.T @ H))[KIP].max()))


@dataclass(frozen=True)
class Recursion:
    """Estimates after each position, from as many positions as unknowns on.

    Attributes
    ----------
    values, sd : arrays, shape (n - p + 1, p) of p unknowns
        `sd` for the noise that all residuals together show.
    """

    values: FloatArray
    sd: FloatArray


def recursive_pair(
    theta_rad: FloatArray,
    a_g: FloatArray,
    b_g: FloatArray,
    gravity_g: float,
    sd_g: FloatArray | None = None,
    *,
    cubic: bool = True,
) -> Recursion:
    """Take one position after the other; NaN while they leave a coefficient open."""
    taken = PairFilter(gravity_g, cubic=cubic)
    values, spreads = [], []
    noise = float("nan")
    for k in range(len(theta_rad)):
        stated = None if sd_g is None else (float(sd_g[k, 0]), float(sd_g[k, 1]))
        estimate = taken.take(float(theta_rad[k]), float(a_g[k]), float(b_g[k]), stated)
        noise = estimate.noise
        if k + 1 >= taken.unknowns:
            known = estimate.values is not None
            values.append(estimate.values if known else np.full(taken.unknowns, np.nan))
            R, _ = taken.triangle()
            spreads.append(
                np.linalg.norm(np.linalg.inv(R), axis=1)
                if known
                else np.full(taken.unknowns, np.nan)
            )
    return Recursion(np.array(values), noise * np.array(spreads))


def converged_at(recursion: Recursion, factor: float = 2.0) -> int:
    """Position, from 1, from which on the sd of both Kip stays within `factor` of the last."""
    sd = recursion.sd[:, KIP].max(axis=1)
    beyond = np.flatnonzero(~(sd <= factor * sd[-1]))
    return int(recursion.values.shape[1]) + (int(beyond[-1]) + 1 if len(beyond) else 0)
