"""Poses that the others contradict, several at once.

Wrong poses hide each other: each is part of what the others are compared with. So sets of poses
compete. A wrong pose has a shift of |a| of its own, normal about 0 with a standard deviation of
`SIZES_G`, which pays for what it explains. About a solution the weighted residuals are
y ~ N(0, C), C = s^2 I + B B^T (`core.posterior`). With W the columns of the shifts, Q = W^T C^-1 W
and b = W^T C^-1 y, shifts of the standard deviation t make ln of the evidence larger by

    b^T (Q + I / t^2)^-1 b / 2 - ln det(I + t^2 Q) / 2.

s is weighed with its prior. Each of the sets of k poses is as probable as the others of k
(`log_prior`). All sets of
up to three are tried among the poses that stand out most, then one pose more at a time. The search
is repeated about the solution without the poses found.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from triaxcal.fitting.core.noise import Linearised, NoisePrior, noise_of
from triaxcal.fitting.core.posterior import Posterior, fit_map
from triaxcal.fitting.recorded.scalar import residual_of
from triaxcal.fitting.recorded.solution import ScalarFit
from triaxcal.model.types import FloatArray, IntArray

SIZES_G = (0.5e-3, 5e-3, 50e-3, 500e-3)
"""Standard deviations of a shift of |a|; each as probable as the others."""
WRONG_LOG_ODDS = -2.0
"""Ln of the odds of one wrong pose against none, before the poses: 1 to 7."""
MARGIN = 3.0
"""Ln of odds of 20 to 1: within it sets of poses, and causes, are one answer."""
_AMONG = 15
"""Poses that stand out most, of which all sets of three are tried."""
_MOST = 6
_SHARE = 4
"""At most one pose of four is looked for: beyond, nobody can say which are the wrong ones."""
_ALL = 3
_SEVERAL = math.log(5.0)
"""Each number of wrong poses above one is a fifth as probable as one. With up to `_MOST` of them
the odds of any against none are 0.27, one recording by hand in 5; with up to one, 1 in 8."""
_NODES = 7
_ROUNDS = 5


@dataclass(frozen=True)
class WrongPoses:
    """Poses that are wrong if any are.

    Attributes
    ----------
    indices : tuple of int
        The largest error first.
    error_g : array, shape (k,)
        |a| - g of them by the others.
    log_odds : float
        Natural logarithm of the odds against no wrong pose, prior odds included.
    others_g : float
        Noise of a pose of weight 1, without them.
    rivals : tuple of int
        Poses of other sets that are nearly as probable.
    """

    indices: tuple[int, ...]
    error_g: FloatArray
    log_odds: float
    others_g: float
    rivals: tuple[int, ...] = ()

    @property
    def told(self) -> bool:
        """Whether it is more probable than none, as in 0 of 150 simulated sound recordings."""
        return self.log_odds > 0.0


def wrong_poses(fit: ScalarFit, noise: NoisePrior) -> WrongPoses | None:
    """The set of wrong poses that is most probable; None of too few poses.

    `fit` is one with priors, by least squares.
    """
    sound = fit.posterior
    assert sound is not None
    most = min(_MOST, len(fit.residual_g) // _SHARE)
    if most < 1:
        return None
    tried: dict[tuple[int, ...], WrongPoses] = {}
    for start in (sound, _without(fit, (), noise, loss="cauchy")):
        at = start
        for _ in range(_ROUNDS):
            best = _Linear.about(fit, at, noise).search(most)[0]
            if best in tried:
                break
            at = _without(fit, best, noise)
            tried[best] = _found(fit, at, best, noise)
    result = max(tried.values(), key=lambda w: w.log_odds)
    if not result.told:
        return result
    near = _Linear.about(fit, _without(fit, result.indices, noise), noise).search(most)
    others = sorted({k for wrong in near for k in wrong} - set(result.indices))
    return replace(result, rivals=tuple(others))


def _without(
    fit: ScalarFit, wrong: tuple[int, ...], noise: NoisePrior, loss: str = "linear"
) -> Posterior:
    """The constants by all poses but these."""
    data, own = fit.data, fit.posterior
    assert own is not None
    weight = data.weight.copy()
    weight[list(wrong)] = 0.0
    count = data.count if len(data.count) else np.ones(len(weight))
    return fit_map(
        lambda theta: residual_of(fit.model, fit.gain_functions, data, theta),
        own.prior,
        weight,
        noise,
        values=float(count.sum() - count[list(wrong)].sum()),
        loss=loss,
    )


def _found(
    fit: ScalarFit, others: Posterior, wrong: tuple[int, ...], noise: NoisePrior
) -> WrongPoses:
    assert fit.posterior is not None
    log_odds = _Linear.about(fit, others, noise).log_odds(wrong) - fit.posterior.log_evidence
    error = residual_of(fit.model, fit.gain_functions, fit.data, others.theta)[0]
    ordered = tuple(sorted(wrong, key=lambda k: -abs(error[k])))
    return WrongPoses(ordered, error[list(ordered)], log_odds, others.scale)


@dataclass(frozen=True)
class _Linear:
    """The problem about a theta: weighted residuals y + B z, and the weights."""

    B: FloatArray
    y: FloatArray
    weight: FloatArray
    values: float
    noise: NoisePrior
    scale: float

    @staticmethod
    def about(fit: ScalarFit, at: Posterior, noise: NoisePrior) -> _Linear:
        residual, slopes = residual_of(fit.model, fit.gain_functions, fit.data, at.theta)
        weight = fit.data.weight
        B = weight[:, None] * (slopes @ at.prior.factor)
        y = weight * (residual - slopes @ (at.theta - at.prior.mean))
        values = fit.data.values
        count = float(len(weight)) if values is None else values
        return _Linear(B, y, weight, count, noise, at.scale)

    def log_odds(self, wrong: tuple[int, ...]) -> float:
        """Ln of the evidence of a set, prior odds included."""
        columns = np.zeros((len(self.y), len(wrong)))
        columns[list(wrong), np.arange(len(wrong))] = self.weight[list(wrong)]
        each = []
        for size in SIZES_G:
            at = Linearised.about(np.hstack([self.B, size * columns]), self.y, self.values)
            each.append(noise_of(at, self.noise).log_evidence)
        total: float = np.logaddexp.reduce(each) - math.log(len(SIZES_G))
        return total + log_prior(len(self.y), len(wrong))

    def search(self, most: int) -> list[tuple[int, ...]]:
        """The most probable sets of up to `most` poses, the best first, at a few values of ln s."""
        low, high = math.log(self.noise.least), math.log(2.0 * self.scale)
        nodes = np.linspace(low, max(high, low + 1.0), _NODES)
        at = Linearised.about(self.B, self.y, self.values)
        base = at.log_likelihood(nodes) + self.noise.log_density(nodes)
        every = np.arange(len(self.y))
        single = _evidence([(Q[:, None, None], b[:, None]) for Q, b in self._each(nodes)], base)
        among = every[np.argsort(-single, kind="stable")[:_AMONG]]
        parts = self._between(nodes, among)
        found: list[tuple[float, tuple[int, ...]]] = []
        last: tuple[int, ...] = ()
        for k in range(1, most + 1):
            sets = list(combinations(range(len(among)), k))
            if k > _ALL:
                sets = [(*last, j) for j in range(len(among)) if j not in last]
            if not sets:
                break
            of = np.array(sets)
            own = [(Q[of[:, :, None], of[:, None, :]], b[of]) for Q, b in parts]
            evidence = _evidence(own, base)
            prior, top = log_prior(len(every), k), float(evidence.max())
            last = sets[int(evidence.argmax())]
            near = np.flatnonzero(evidence > top - MARGIN).tolist()
            found += [(float(evidence[n] + prior), sets[n]) for n in near]
        found.sort(key=lambda pair: -pair[0])
        near_best = [wrong for score, wrong in found if score > found[0][0] - MARGIN]
        return [tuple(sorted(int(among[j]) for j in wrong)) for wrong in near_best]

    def _each(self, nodes: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
        """Q (n,) and b (n,) of a shift of each pose alone, at each ln s."""
        parts = []
        for square in np.exp(2.0 * nodes):
            X = self._inner(float(square))
            Q = self.weight**2 * (1.0 - (self.B * X.T).sum(axis=1)) / square
            parts.append((Q, self.weight * (self.y - self.B @ (X @ self.y)) / square))
        return parts

    def _between(self, nodes: FloatArray, some: IntArray) -> list[tuple[FloatArray, FloatArray]]:
        """Q (m, m) and b (m,) of shifts of some poses, at each ln s."""
        parts = []
        own, weight = self.B[some], self.weight[some]
        for square in np.exp(2.0 * nodes):
            X = self._inner(float(square))
            Q = (np.eye(len(some)) - own @ X[:, some]) * np.outer(weight, weight) / square
            parts.append((Q, weight * (self.y[some] - own @ (X @ self.y)) / square))
        return parts

    def _inner(self, square: float) -> FloatArray:
        """(s^2 I + B^T B)^-1 B^T."""
        A = self.B.T @ self.B
        A.flat[:: len(A) + 1] += square
        return np.asarray(np.linalg.solve(A, self.B.T))


def _evidence(parts: list[tuple[FloatArray, FloatArray]], base: FloatArray) -> FloatArray:
    """Ln of the evidence of sets of shifts, of Q (m, k, k) and b (m, k) at each s."""
    each = []
    for (Q, b), known in zip(parts, base, strict=True):
        for size in SIZES_G:
            inner = size**2 * Q
            inner += np.eye(b.shape[1])
            best = np.linalg.solve(inner, b[:, :, None])[:, :, 0]
            log_det = np.linalg.slogdet(inner)[1]
            each.append(known + 0.5 * (size**2 * (b * best).sum(axis=1) - log_det))
    result: FloatArray = np.logaddexp.reduce(each, axis=0)
    return result


def log_prior(count: int, wrong: int) -> float:
    """Of one set of so many of `count` poses, against no wrong pose."""
    several = _SEVERAL if wrong > 1 else 0.0
    return WRONG_LOG_ODDS - several - math.log(math.comb(count, wrong))
