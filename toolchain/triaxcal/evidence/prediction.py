"""Held-out rests and turns against what the solution of the rest of the recording predicts.

One pass of the filter measures everything but the stretches, and forgets the attitude at the end of
each. Its equations of the stretches are kept. With beta = beta_0 - B p + w along a stretch (gyros
alone), the mean of P2 (8) over a rest r is

    y_r = H (beta_0 - B_r p + w_r) + F_r p + v_r.

Differences of the horizontal parts of two rests that follow each other are free of beta_0: the
closure of the turn between them, that is the angle between where the gyros say that up is and where
the accelerometers find it. The length of the mean force less g needs no attitude. Both are linear
in the error of the constants, whose covariance is that of the solution, and in noise:

    var(w_r - w_q) = N^2 (gap + (T_q + T_r)/3),      w the angle random walk, means over T_q and T_r
    cov(w_r - w_q, w_s - w_r) = N^2 T_r/6,
    var(v_r) = a^2/T_r + counting;

lost samples add theirs.

The two outer rests of a stretch are in the solution too. That makes their own errors smaller than
the covariance states, never larger.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.preintegrate import BlockEquations
from triaxcal.dynamic.wander import Wander
from triaxcal.dynamic.window import Frame
from triaxcal.evidence.stretches import Stretch
from triaxcal.model.types import BoolArray, FloatArray

ROWS = 5
"""Of a stretch: both components of two closures, rad, and |a| - g of the middle rest, m/s^2."""
LENGTH = 4
"""Which of them is |a| - g."""


@dataclass(frozen=True)
class Predicted:
    """What a stretch measures, less what it is predicted to: linear in the constants.

    Attributes
    ----------
    stretch : Stretch
    y : array, shape (5,)
        Closures of the first and of the second turn (2, 2), rad; |a| - g of the middle rest, m/s^2.
    J : array, shape (5, n)
        y = J p + noise, p the error of the constants that y was computed about.
    noise : array, shape (5, 5)
        Covariance of the noise.
    turned_rad : tuple of two floats
        How far the unit turned, the sum over both turns of |rate| dt.
    """

    stretch: Stretch
    y: FloatArray
    J: FloatArray
    noise: FloatArray
    turned_rad: tuple[float, float]


@dataclass
class _Sums:
    """Of one rest, over its blocks."""

    blocks: int = 0
    seconds: float = 0.0
    start_s: float = np.nan
    end_s: float = np.nan
    force: FloatArray | float = 0.0
    F: FloatArray | float = 0.0
    B: FloatArray | float = 0.0
    turn_variance: float = 0.0
    force_variance: float = 0.0


@dataclass
class StretchWatch:
    """Takes the equations of the stretches from a pass of the filter.

    Stretches do not overlap, and lie in their order. `end_s` is the end of the recording.
    """

    stretches: tuple[Stretch, ...]
    frame: Frame
    noise: DataSheet
    wander: Wander
    end_s: float
    predicted: list[Predicted] = field(default_factory=list)
    _next: int = 0
    _B: FloatArray | None = None
    _sums: list[_Sums] = field(default_factory=list)
    _turned: list[float] = field(default_factory=list)
    _turn_variance: float = 0.0

    def level(self, time_s: FloatArray) -> BoolArray:
        """Not within a stretch: there the gyros alone carry the attitude."""
        free = np.ones(len(time_s), dtype=bool)
        for stretch in self.stretches:
            free &= (time_s < stretch.before.start_s) | (time_s > stretch.after.end_s)
        return free

    def segment(self, time_s: FloatArray, made: BlockEquations) -> None:
        """Add the blocks that lie in a stretch."""
        b, blocks = 0, len(time_s) - 1
        while b < blocks and self._next < len(self.stretches):
            stretch = self.stretches[self._next]
            if time_s[b + 1] <= stretch.after.end_s:
                if time_s[b] >= stretch.before.start_s:
                    self._add(stretch, b, time_s, made)
                b += 1
                continue
            self._end(stretch)

    def end(self) -> tuple[Predicted, ...]:
        """What was found, the stretch at the recording's end included."""
        if self._next < len(self.stretches):
            self._end(self.stretches[self._next])
        return tuple(self.predicted)

    def _add(self, stretch: Stretch, b: int, time_s: FloatArray, made: BlockEquations) -> None:
        G = made.G[b]
        if self._B is None:
            self._B = np.zeros_like(G)
            self._sums, self._turned = [_Sums() for _ in range(3)], [0.0, 0.0]
            self._turn_variance = 0.0
        self._turn_variance += made.turn_variance[b]
        middle = self._B + G / 2 - made.G_lag[b]
        self._B = self._B + G
        start, end = float(time_s[b]), float(time_s[b + 1])
        for sums, rest in zip(self._sums, stretch.rests, strict=True):
            if start >= rest.start_s and end <= rest.end_s:
                first = sums.blocks == 0
                sums.start_s = start if first else sums.start_s
                sums.end_s = end
                sums.blocks += 1
                sums.seconds += end - start
                sums.force = sums.force + made.y[b]
                sums.F = sums.F + made.F[b]
                sums.B = sums.B + middle
                sums.turn_variance = self._turn_variance
                sums.force_variance += made.force_variance[b]
        turn = made.C[b].T @ made.C[b + 1]
        cosine = float(np.clip((np.trace(turn) - 1) / 2, -1, 1))
        self._turned[int(start > stretch.middle.start_s)] += float(np.arccos(cosine))

    def _end(self, stretch: Stretch) -> None:
        sums = self._sums
        self._next += 1
        self._B, self._sums = None, []
        if sums and all(s.blocks for s in sums):
            self.predicted.append(self._predicted(stretch, sums))

    def _predicted(self, stretch: Stretch, sums: list[_Sums]) -> Predicted:
        g, frame = self.frame.gravity, self.frame
        mean = np.array([s.force / s.blocks for s in sums])
        F = np.array([s.F / s.blocks for s in sums])
        B = np.array([s.B / s.blocks for s in sums])
        H = np.array([[0.0, -g, 0.0], [g, 0.0, 0.0]])
        # y = y_about - (derivative) p: an error of the constants is seen with a minus in H B.
        rows = F[:, :2] - H @ B
        closure, slope = np.diff(mean[:, :2], axis=0) / g, np.diff(rows, axis=0) / g
        up = mean[1] + np.array([0.0, 0.0, g])
        length = np.linalg.norm(up)
        y = np.array([*closure.ravel(), length - g])
        J = np.concatenate([slope.reshape(4, -1), (up / length @ F[1])[None]])
        J[:, frame.layout.reset_columns()] = 0.0
        noise = self._covariance(sums) + self._wandering(J, sums[1].start_s)
        J = J[:, : self.wander.constants]
        turned = self._turned[0], self._turned[1]
        return Predicted(stretch, y, J, noise, turned)

    def _covariance(self, sums: list[_Sums]) -> FloatArray:
        g, frame = self.frame.gravity, self.frame
        walk = self.noise.rate_density**2
        v = [
            self.noise.mean_force_variance(
                s.seconds, s.blocks * frame.block, frame.force_convention
            )
            for s in sums
        ]
        turn = [
            walk * (b.start_s - a.end_s + (a.seconds + b.seconds) / 3) + (va + vb) / g**2
            for a, b, va, vb in zip(sums, sums[1:], v, v[1:], strict=False)
        ]
        both = walk * sums[1].seconds / 6 - v[1] / g**2
        one = np.eye(2)
        covariance = np.zeros((ROWS, ROWS))
        covariance[:4, :4] = np.kron([[turn[0], both], [both, turn[1]]], one)
        covariance[LENGTH, LENGTH] = v[1]
        return covariance

    def _wandering(self, J: FloatArray, time_s: float) -> FloatArray:
        """What biases that wander add, as if they stood still in a stretch.

        Of Gauss-Markov states nothing else is known; a random walk is known at the end.
        """
        wander, constants = self.wander, self.wander.constants
        variance = np.zeros(J.shape[1])
        variance[constants:] = wander.layout.prior_sd[constants:] ** 2
        walks = np.isinf(wander.memory_s)
        variance[wander.columns[walks]] = wander.sd[walks] ** 2 * max(self.end_s - time_s, 0.0)
        return (J * variance) @ J.T
