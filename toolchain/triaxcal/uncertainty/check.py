"""A delivered calibration against a recording that was not used for it.

Of n poses r = |a| - g is held against its covariance (`uncertainty.expected`): the calibration
passes where

    r^T cov(r)^-1 r / n    is no larger than Fisher's F with n and nu degrees of freedom gives once
                           in 1 / CHANCE checks of a sound unit, and
    |r_i|                  is within the unit's limit in each pose, by the C as by the model.

Where it fails, causes of one kind are fitted by generalised least squares: those that leave an
ordinary chi-square are named, all of them, with as few parameters as any needs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from triaxcal.fitting.core.outliers import CHANCE
from triaxcal.fitting.field.poses import FieldPoses, inside_range
from triaxcal.model.types import FloatArray
from triaxcal.uncertainty.expected import Expected, chance_of, expected
from triaxcal.uncertainty.explain import Explanation, Parts, explain, suspect

_POWER = 1.645
"""Normal quantile of 95 %: how surely a change is to be seen."""
_SEEN_MAX_G = 0.5
"""A larger change of a bias is no small one any more: it counts as not seen."""


@dataclass(frozen=True)
class FieldCheck:
    """Result of a check.

    Attributes
    ----------
    poses : FieldPoses
        Those within the working range.
    expected : Expected
        Errors by the fitted model, and their uncertainty.
    c_error_g : array, shape (n,), or None
        |a| - g by the integers of the C.
    limit_g : array, shape (n,)
        Limit of each pose.
    chance : float
        Chance of such a chi-square, or of a larger one, for a sound unit.
    explanations : tuple of Explanation
        Of a failure, with the fewest parameters; none where no single cause explains it.
    suspicions : tuple of str
        What else the recording may be.
    seen_bias_g : array, shape (3,)
        Change of the bias of x, y, z that the check finds in 95 of 100 cases; inf where it cannot.
    """

    poses: FieldPoses
    expected: Expected
    c_error_g: FloatArray | None
    limit_g: FloatArray
    chance: float
    explanations: tuple[Explanation, ...]
    suspicions: tuple[str, ...]
    seen_bias_g: FloatArray

    @property
    def worst(self) -> int:
        """The pose that is nearest to its limit, or farthest beyond it."""
        return int((self.largest_g / self.limit_g).argmax())

    @property
    def largest_g(self) -> FloatArray:
        """| |a| - g | of each pose, the larger of model and C, shape (n,)."""
        own = np.abs(self.expected.error_g)
        return own if self.c_error_g is None else np.maximum(own, np.abs(self.c_error_g))

    @property
    def consistent(self) -> bool:
        """Whether chi-square is what the uncertainty leads to expect."""
        return self.chance >= CHANCE

    @property
    def within_limits(self) -> bool:
        """Whether every pose is within its limit."""
        return bool((self.largest_g <= self.limit_g).all())

    @property
    def passed(self) -> bool:
        """Whether the calibration is confirmed."""
        return self.consistent and self.within_limits


def check_poses(
    parts: Parts,
    poses: FieldPoses,
    gravity_g: float,
    c_error_g: FloatArray | None = None,
) -> FieldCheck:
    """Hold a calibration against poses within its working range.

    Raises
    ------
    RefusedError
        When no pose is within the range, or the calibration does not know its uncertainty.
    """
    unit, _, calibration = parts
    poses = inside_range(poses, calibration.range_degc)
    found = expected(*parts, poses, gravity_g)
    count = len(poses)
    chance = chance_of(found.chi_square, count, found.dof)
    explanations: tuple[Explanation, ...] = ()
    suspicions: tuple[str, ...] = ()
    if chance < CHANCE:
        explanations = explain(found, poses)
        suspicions = suspect(parts, poses, gravity_g, found, explained=bool(explanations))
    limits = [unit.limits.at(t, unit.t0_degc)[0] for t in poses.temps_degc.tolist()]
    return FieldCheck(
        poses,
        found,
        c_error_g,
        np.array(limits),
        chance,
        explanations,
        suspicions,
        _seen_bias(found),
    )


def _seen_bias(found: Expected) -> FloatArray:
    """Change of each bias that makes chi-square fail in 95 of 100 cases, shape (3,), g.

    Chi-square of n values with the non-centrality h is about normal with the mean n + h and the
    variance 2 n + 4 h; it has to exceed the quantile that `CHANCE` allows.
    """
    u = found.force_g / np.linalg.norm(found.force_g, axis=1, keepdims=True)
    information = (u * found.solve(u)).sum(axis=0)
    count, low, high = len(u), 1.0, 1e6
    for _ in range(60):
        middle = math.sqrt(low * high)
        over = chance_of(middle * count, count, found.dof) >= CHANCE
        low, high = (middle, high) if over else (low, middle)
    quantile, h = high * count, 0.0
    for _ in range(50):
        h = quantile - count + _POWER * math.sqrt(2.0 * count + 4.0 * h)
    seen = np.sqrt(h / np.maximum(information, 1e-300))
    result: FloatArray = np.where(seen < _SEEN_MAX_G, seen, np.inf)
    return result
