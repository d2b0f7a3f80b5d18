"""Covariance of an IMU's constants from rests and turns alone: a filter of one step each.

States are the error of the attitude (3), on the instrument's axes, and the constants p. A gyro that
reads dw too much turns the attitude psi that it gives by dw, so that up comes out as u - psi x u,
and forces at rest are off by

    r = F p + g psi x u + noise                 F: rows of force of the blocks of states
    psi' = R psi + sum_k R_k W_k p dt + noise   R_k: from the axes of moment k to those of the end

with W the blocks' rows of rate. Forces are not used while the unit turns; lever arms and the north
are left out. The filter of `dynamic` has all of that, and its covariance is taken over once there
is one.
"""

from __future__ import annotations

import numpy as np

from triaxcal.dynamic.blocks.attitude import skew
from triaxcal.dynamic.blocks.block import Signals
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.noise import DataSheet
from triaxcal.guide.turns import Turn
from triaxcal.model.types import FloatArray

PART_S, PARTS_MAX = 0.7, 12
"""For about a second the gyros of a MEMS unit know a tilt better than its accelerometers do."""
_TILT_SD_RAD = 0.1
"""Before the first rest."""
_AZIMUTH_SD_RAD = 1e-4
"""At the first rest: the azimuth of a frame that has none of its own is what it is called."""


class StepModel:
    """Covariance of attitude and constants.

    Parameters
    ----------
    covariance : array, shape (n, n), or None
        Of the constants, SI; None: the priors of the layout.
    """

    def __init__(
        self, layout: Layout, noise: DataSheet, gravity: float, covariance: FloatArray | None = None
    ) -> None:
        self.layout, self._gravity = layout, gravity
        self._rate_variance = noise.rate_density**2
        self._force_variance = noise.force_density() ** 2
        n = len(layout)
        self._p = np.zeros((3 + n, 3 + n))
        self._begun = False
        self._p[3:, 3:] = np.diag(layout.prior_sd**2) if covariance is None else covariance[:n, :n]

    def copy(self) -> StepModel:
        """The same, to go on from."""
        other = object.__new__(StepModel)
        other.__dict__ = self.__dict__ | {"_p": self._p.copy()}
        return other

    @property
    def sd(self) -> FloatArray:
        """Standard deviations of the constants (n,), SI."""
        found: FloatArray = np.sqrt(np.diag(self._p)[3:])
        return found

    def level(self, up: FloatArray, seconds: float) -> None:
        """See at a rest how the unit leans, and nothing else: what it showed is known already."""
        self._begin(up)
        across = np.linalg.svd(up[None])[2][1:]
        self._measure(across @ self._rows(up), self._force_variance / seconds)

    def rest(self, up: FloatArray, seconds: float) -> None:
        """A rest, in parts of about `PART_S`, each with its mean in the middle."""
        self._begin(up)
        still = self._gains(np.zeros((1, 3)), up[None], np.eye(3)[None], 1.0)
        count = min(max(2, round(seconds / PART_S)), PARTS_MAX)
        half_s = seconds / count / 2
        for _ in range(count):
            self._drift(np.eye(3), still * half_s, half_s)
            self._measure(self._rows(up), self._force_variance / (2 * half_s))
            self._drift(np.eye(3), still * half_s, half_s)

    def turn(self, turn: Turn, up: FloatArray) -> FloatArray:
        """A turn as it is asked for; returns up after it."""
        if turn.angle_deg:
            self.moved(*turn.path(up))
        return turn.end(up)

    def moved(self, rate: FloatArray, ups: FloatArray, to_end: FloatArray, step_s: float) -> None:
        """A motion: rate and up (n, 3) at n moments, rotations (n, 3, 3) to the axes of the end."""
        self._drift(to_end[0], self._gains(rate, ups, to_end, step_s), step_s * len(rate))

    def _begin(self, up: FloatArray) -> None:
        """Attitude of the first rest."""
        if not self._begun:
            along = np.outer(up, up)
            tilt = (np.eye(3) - along) * _TILT_SD_RAD**2
            self._p[:3, :3] = tilt + along * _AZIMUTH_SD_RAD**2
            self._begun = True

    def _rows(self, up: FloatArray) -> FloatArray:
        """Rows (3, 3 + n) of the force at rest."""
        forces = self.layout.rows("force", self._signals(np.zeros((1, 3)), up[None]))[0]
        return np.hstack([-self._gravity * skew(up), forces])

    def _gains(
        self, rate: FloatArray, ups: FloatArray, to_end: FloatArray, step_s: float
    ) -> FloatArray:
        """What the constants turn the attitude by, (3, n)."""
        rows = self.layout.rows("rate", self._signals(rate, ups))
        gains: FloatArray = np.einsum("kij,kjn->in", to_end, rows) * step_s
        return gains

    def _signals(self, rate: FloatArray, ups: FloatArray) -> Signals:
        zero = np.zeros(len(rate))
        return Signals(rate, rate, ups * self._gravity, zero, self._gravity, triad=np.eye(3))

    def _drift(self, rotation: FloatArray, gains: FloatArray, seconds: float) -> None:
        step = np.eye(len(self._p))
        step[:3, :3], step[:3, 3:] = rotation, gains
        self._p = step @ self._p @ step.T
        self._p[:3, :3] += np.eye(3) * self._rate_variance * seconds

    def _measure(self, rows: FloatArray, variance: float) -> None:
        across = rows @ self._p
        seen = across @ rows.T + np.eye(len(rows)) * variance
        gain = np.linalg.solve(seen, across).T
        left = np.eye(len(self._p)) - gain @ rows
        self._p = left @ self._p @ left.T + gain @ gain.T * variance
