"""A delivered calibration against a recording that was not used for it.

Of n poses r = |a| - g is held against its covariance (`uncertainty.expected`): the calibration
passes where

    r^T cov(r)^-1 r / n    is no larger than Fisher's F with n and nu degrees of freedom gives once
                           in 1 / CHANCE checks of a sound unit, and
    |r_i|                  is beyond the unit's limit in no pose, by the C as by the model, by more
                           than its noise: than the quantile of Student's t, with nu degrees of
                           freedom, that any of n poses exceeds once in 1 / CHANCE checks.

Where it fails, causes of one kind are fitted (`uncertainty.explain`): those that leave an ordinary
chi-square are named, all of them, with as few values as any needs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from triaxcal.fitting.core.outliers import CHANCE, noncentrality
from triaxcal.fitting.field.poses import FieldPoses, inside_range
from triaxcal.fixedpoint.integer_model import STATUS_RAW_RANGE, STATUS_SATURATED
from triaxcal.model.types import BoolArray, FloatArray, IntArray
from triaxcal.uncertainty.expected import Expected, chance_of, exceeded_with, expectation
from triaxcal.uncertainty.explain import Explanation, Parts, why

_POWER = 0.95
"""How surely a change is to be seen."""
_SEEN_MAX_G = 0.5
"""A larger change of a bias is no small one any more: it counts as not seen."""
_STATUS = (
    (STATUS_RAW_RANGE, "have raw codes beyond those of the calibration: the C clamps them"),
    (STATUS_SATURATED, "are beyond what the C can give: it saturates"),
)


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
    c_status : array of int, shape (n,), or None
        Status that the C gives there.
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
    c_status: IntArray | None
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
    def noise_g(self) -> FloatArray:
        """What the noise of each of the n poses exceeds once in 1 / `CHANCE` checks, shape (n,)."""
        square = exceeded_with(2.0 * CHANCE / len(self.poses), 1, self.expected.dof)
        result: FloatArray = math.sqrt(square) * self.expected.own_sd_g
        return result

    @property
    def beyond(self) -> BoolArray:
        """Whether each pose is beyond its limit by more than its noise, shape (n,)."""
        result: BoolArray = self.largest_g > self.limit_g + self.noise_g
        return result

    @property
    def undecided(self) -> BoolArray:
        """Whether each pose is beyond its limit by less than its noise, shape (n,)."""
        result: BoolArray = (self.largest_g > self.limit_g) & ~self.beyond
        return result

    @property
    def flagged(self) -> tuple[str, ...]:
        """Poses where the C gives a status, in words."""
        if self.c_status is None:
            return ()
        found = []
        for bit, words in _STATUS:
            where = np.flatnonzero(self.c_status & bit)
            if len(where):
                share = f"{len(where)} of {len(self.poses)} poses"
                first = self.poses.names[int(where[0])]
                found.append(f"{share} ({first}) {words} and sets status {bit}")
        return tuple(found)

    @property
    def consistent(self) -> bool:
        """Whether chi-square is what the uncertainty leads to expect."""
        return self.chance >= CHANCE

    @property
    def within_limits(self) -> bool:
        """Whether no pose is beyond its limit by more than its noise."""
        return not self.beyond.any()

    @property
    def passed(self) -> bool:
        """Whether the calibration is confirmed."""
        return self.consistent and self.within_limits


def check_poses(
    parts: Parts,
    poses: FieldPoses,
    gravity_g: float,
    c_force_g: FloatArray | None = None,
    c_status: IntArray | None = None,
) -> FieldCheck:
    """Hold a calibration against poses within its working range.

    Parameters
    ----------
    c_force_g, c_status : arrays, shapes (n, 3) and (n,), or None
        What the C gives there.

    Raises
    ------
    RefusedError
        When no pose is within the range, or the calibration does not know its uncertainty.
    """
    unit, _, calibration = parts
    poses = inside_range(poses, calibration.range_degc)
    expects = expectation(*parts, poses.temps_degc)
    found = expects.at(poses, gravity_g)
    chance = chance_of(found.chi_square, len(poses), found.dof)
    explanations, suspicions = (
        why(expects, poses, gravity_g, found) if chance < CHANCE else ((), ())
    )
    limits = [unit.limits.at(t, unit.t0_degc)[0] for t in poses.temps_degc.tolist()]
    c_error_g = None if c_force_g is None else np.linalg.norm(c_force_g, axis=1) - gravity_g
    return FieldCheck(
        poses,
        found,
        c_error_g,
        c_status,
        np.array(limits),
        chance,
        explanations,
        suspicions,
        _seen_bias(found),
    )


def _seen_bias(found: Expected) -> FloatArray:
    """Change of each bias that makes chi-square fail in 95 of 100 cases, shape (3,), g.

    A change adds a non-centrality to chi-square, which over its n values is Fisher's F of n and nu
    degrees of freedom: it has to exceed the quantile that `CHANCE` allows.
    """
    u = found.force_g / np.linalg.norm(found.force_g, axis=1, keepdims=True)
    information = (u * found.solve(u)).sum(axis=0)
    count = len(u)
    quantile = exceeded_with(CHANCE, count, found.dof)
    h = noncentrality(_POWER, count, found.dof, quantile / count)
    seen = np.sqrt(h / np.maximum(information, 1e-300))
    result: FloatArray = np.where(seen < _SEEN_MAX_G, seen, np.inf)
    return result
