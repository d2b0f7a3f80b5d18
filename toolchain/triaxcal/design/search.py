"""Every choice of temperatures, each with the shortest dwell that reaches the target.

A reading has the variance v = s^2 / (f t) + floor^2, a tilt p about each axis. K_ij is a half
difference of two dwells, U0_i the mean of six, so at 1 g in the direction n

    var a_i = v (1/2 + 1/6) + p g^2 ((1 - n_i^2) / 2 + 1/9)  <=  2/3 v + 11/18 p g^2,

the same for |a|. Curves that are polynomials b(T) of m points multiply it by

    h(T) = b(T)^T (sum_k b(T_k) b(T_k)^T)^-1 b(T),

whose largest value over the range counts. (m = 1 temperature of order 0: h = 1.)
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.design.problem import Problem
from triaxcal.model.types import FloatArray
from triaxcal.unit.thermal import T0_TOLERANCE_DEGC

COVERAGE = 1.96
"""k of 95 %: a dwell has thousands of readings."""
NOISE_SHARE, TILT_SHARE = 2.0 / 3.0, 11.0 / 18.0
DWELL_STEP_S, DWELL_MAX_S = 10, 3600
"""Of a dwell's averaging: ten batch means, and the longest that a session takes."""
SETTLING_S = 37.0
"""Of each dwell beside its averaging: 5 s at rest, 20 s of settling, 12 s of watching."""
REFERENCE_S = 120.0
"""Once a session, to learn the noise."""
USUAL_TEMPERATURES, USUAL_DWELL_S = 7, 60
_GRID = 221


@dataclass(frozen=True)
class Design:
    """A plan: six positions at each of `temps_degc`, `dwell_s` of averaging in each.

    Attributes
    ----------
    expanded_g : float
        Largest over range and orientation, of noise and repeatability.
    chamber_s : float
        From T0 to the end of the last dwell.
    leverage : float
        Largest h over the range.
    """

    temps_degc: tuple[float, ...]
    dwell_s: int
    expanded_g: float
    chamber_s: float
    leverage: float


def usual(problem: Problem) -> Design:
    """Seven temperatures evenly over the range, the nearest at T0, six positions, 60 s."""
    temps = np.linspace(problem.temps_degc[0], problem.temps_degc[-1], USUAL_TEMPERATURES)
    inner = 1 + int(np.argmin(np.abs(temps[1:-1] - problem.t0_degc)))
    temps[inner] = problem.t0_degc
    return design(problem, tuple(sorted(float(round(t, 1)) for t in temps)), USUAL_DWELL_S)


def best(problem: Problem, target_g: float) -> Design:
    """The plan that reaches the target in the least chamber time.

    Raises
    ------
    RefusedError
        When no plan does: by what factor, and why.
    """
    found: Design | None = None
    lowest = math.inf
    for temps in _choices(problem):
        h = leverage(problem, temps)
        lowest = min(lowest, h)
        dwell_s = _dwell_s(problem, h, target_g)
        if dwell_s is None:
            continue
        chamber = chamber_s(problem, temps, dwell_s)
        if found is None or chamber < found.chamber_s:
            found = Design(temps, dwell_s, expanded_g(problem, h, dwell_s), chamber, h)
    if found is None:
        raise _unreachable(problem, lowest, target_g)
    return found


def design(problem: Problem, temps_degc: tuple[float, ...], dwell_s: int) -> Design:
    """A given plan, evaluated."""
    h = leverage(problem, temps_degc)
    return Design(
        temps_degc,
        dwell_s,
        expanded_g(problem, h, dwell_s),
        chamber_s(problem, temps_degc, dwell_s),
        h,
    )


def leverage(problem: Problem, temps_degc: tuple[float, ...]) -> float:
    """Largest h over the range, that of the candidates."""
    grid = np.linspace(problem.temps_degc[0], problem.temps_degc[-1], _GRID)
    points, wanted = _basis(problem, np.array(temps_degc)), _basis(problem, grid)
    inverse = np.linalg.inv(points.T @ points)
    return float(np.max(np.einsum("tp,pq,tq->t", wanted, inverse, wanted)))


def expanded_g(problem: Problem, leverage_max: float, dwell_s: int) -> float:
    """Expanded uncertainty of a component, and of |a|, at 1 g."""
    v = problem.reading_g**2 / (problem.rate_hz * dwell_s) + problem.floor_g**2
    variance = NOISE_SHARE * v + TILT_SHARE * problem.repeatability_rad**2
    return COVERAGE * math.sqrt(leverage_max * variance)


def chamber_s(problem: Problem, temps_degc: tuple[float, ...], dwell_s: int) -> float:
    """Ramps from T0 down and up, soaks, dwells with what surrounds them."""
    low, high = temps_degc[0], temps_degc[-1]
    ramps = 60.0 * (abs(problem.t0_degc - low) + high - low) / problem.ramp_k_per_min
    dwell = problem.turn_s + SETTLING_S + dwell_s
    return REFERENCE_S + ramps + len(temps_degc) * (problem.soak_s + 6.0 * dwell)


def _basis(problem: Problem, temps_degc: FloatArray) -> FloatArray:
    middle = 0.5 * (problem.temps_degc[0] + problem.temps_degc[-1])
    half = 0.5 * (problem.temps_degc[-1] - problem.temps_degc[0])
    result: FloatArray = np.vander((temps_degc - middle) / half, problem.order + 1)
    return result


def _choices(problem: Problem) -> list[tuple[float, ...]]:
    """Subsets with both ends and T0, of two temperatures more than the order or more."""
    temps = problem.temps_degc
    at_t0 = min(temps, key=lambda t: abs(t - problem.t0_degc))
    assert abs(at_t0 - problem.t0_degc) <= T0_TOLERANCE_DEGC
    fixed = {temps[0], temps[-1], at_t0}
    free = [t for t in temps if t not in fixed]
    least = max(0, problem.order + 2 - len(fixed))
    return [
        tuple(sorted(fixed | set(more)))
        for count in range(least, len(free) + 1)
        for more in itertools.combinations(free, count)
    ]


def _dwell_s(problem: Problem, leverage_max: float, target_g: float) -> int | None:
    """Shortest dwell that reaches the target; None when none does."""
    left = (target_g / COVERAGE) ** 2 / leverage_max
    left = (left - TILT_SHARE * problem.repeatability_rad**2) / NOISE_SHARE - problem.floor_g**2
    if left <= 0.0:
        return None
    needed = problem.reading_g**2 / (problem.rate_hz * left)
    # The 1e-9 forgives the rounding of a target that is a plan's own value.
    dwell = DWELL_STEP_S * max(1, math.ceil(needed / DWELL_STEP_S - 1e-9))
    return dwell if dwell <= DWELL_MAX_S else None


def _unreachable(problem: Problem, lowest: float, target_g: float) -> RefusedError:
    reached = expanded_g(problem, lowest, DWELL_MAX_S)
    tilt = TILT_SHARE * problem.repeatability_rad**2
    floor = NOISE_SHARE * problem.floor_g**2
    noise = NOISE_SHARE * problem.reading_g**2 / (problem.rate_hz * DWELL_MAX_S)
    causes = {
        "the tilter's repeatability": tilt,
        "the floor that averaging does not remove": floor,
        "the noise": noise,
    }
    worst = max(causes, key=lambda name: causes[name])
    return RefusedError(
        f"{problem.source}, [target] expanded_micro_g",
        f"all {len(problem.temps_degc)} candidates with dwells of {DWELL_MAX_S} s reach "
        f"{reached * 1e6:.3g} micro-g, {reached / target_g:.3g} times the target, mostly by "
        f"{worst}",
        expected=f"a target of {reached * 1e6:.3g} micro-g or more",
        remedy="improve that, add candidates, or set a larger target",
    )
