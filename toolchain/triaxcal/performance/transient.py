"""The transient after switching on: exponentials in noise that is white and a random walk.

    y(t) = c + sum_k A_k exp(-t / tau_k) + walk + white,      t from switching on

is fitted to means over blocks that grow with time. White noise of a block of n samples has the
variance s^2 / n, the walk the covariance s^2 rho min(t_i, t_j). With the eigenvectors of
sqrt(n_i n_j) min(t_i, t_j) both are diagonal for every rho; c, A_k and s^2 follow by linear least
squares, so that the likelihood is searched over ln tau_k and ln rho alone. A first or second
exponential is taken where it raises 2 ln L by `SIGNIFICANT` (0.1 %, two degrees of freedom).

The uncertainty is that of generalised least squares with the noise found: errors of a random walk
look like a slow exponential, and are in it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from triaxcal.model.types import FloatArray

SIGNIFICANT = 13.8
_PROMISING = 3.0
"""Of a first guess of one more exponential: it is refined where 2 ln L rises by as much."""
_BLOCKS = 96
_RHO = np.geomspace(1e-7, 1e2, 7)
_TAUS = 8


@dataclass(frozen=True)
class Transient:
    """The transient of one output in one run.

    Attributes
    ----------
    tau_s, amplitude : arrays, shape (k,)
        Slowest last; k is 0 where none is seen. Amplitudes are those at the time of switching on.
    covariance : array, shape (2 k, 2 k)
        Of ln tau_1 ... and A_1 ...
    steady : float
        Mean of the last quarter without the exponentials.
    limit : float
        Where k is 0: largest amplitude that would not have been seen.
    """

    tau_s: FloatArray
    amplitude: FloatArray
    covariance: FloatArray
    steady: float
    limit: float

    def at(self, t: FloatArray | float) -> FloatArray:
        """Distance from the steady output, shape of `t`."""
        t = np.asarray(t, dtype=np.float64)
        result: FloatArray = np.exp(-t[..., None] / self.tau_s) @ self.amplitude
        return result

    def settled_s(self, band: float) -> tuple[float, float]:
        """Time after which the transient stays within a band, and its standard uncertainty.

        From f(t, p) = +-band: dt = -(df/dp) / (df/dt) dp.
        """
        if not len(self.tau_s):
            return 0.0, 0.0
        end = float(self.tau_s.max()) * max(
            1.0, math.log(max(float(np.abs(self.amplitude).sum()) / band, 1.0)) + 1.0
        )
        grid = np.linspace(0.0, end, 4001)
        outside = np.flatnonzero(np.abs(self.at(grid)) > band)
        if not len(outside):
            return 0.0, 0.0
        low = float(grid[outside[-1]])
        high = low + end / 4000.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if abs(float(self.at(middle))) > band else (low, middle)
        decay = np.exp(-low / self.tau_s)
        by_time = float(-(self.amplitude / self.tau_s) @ decay)
        slopes = np.concatenate([self.amplitude * decay * low / self.tau_s, decay])
        variance = float(slopes @ self.covariance @ slopes)
        return low, math.sqrt(max(variance, 0.0)) / max(abs(by_time), 1e-300)


class _Blocks:
    """Means over growing blocks, in coordinates in which both noises are diagonal."""

    def __init__(self, time_s: FloatArray, signal: FloatArray) -> None:
        n = len(time_s)
        edges = np.unique(np.round(np.geomspace(1.0, n + 1.0, _BLOCKS + 1)).astype(np.int64)) - 1
        start, count = edges[:-1], np.diff(edges)
        self.count = count.astype(np.float64)
        self.time = np.add.reduceat(time_s, start) / count
        self.half = (
            0.5 * (time_s[edges[1:] - 1] - time_s[start]) * (count + 1) / np.maximum(count, 2)
        )
        self.value = np.add.reduceat(signal, start) / count
        root = np.sqrt(self.count)
        elapsed = self.time - self.time[0]
        walk = np.minimum(elapsed[:, None], elapsed[None, :]) / max(float(elapsed[-1]), 1e-300)
        eigen, vectors = np.linalg.eigh(root[:, None] * walk * root[None, :])
        self.eigen, self.rotate = np.maximum(eigen, 0.0), vectors.T * root
        self.rotated = self.rotate @ self.value

    def exponential(self, tau: float) -> FloatArray:
        """Means of exp(-t / tau) over the blocks: exp(-t_mean / tau) sinh(h / tau) / (h / tau)."""
        x = self.half / tau
        result: FloatArray = np.exp(-self.time / tau) * _sinh_by(x)
        return result

    def slope(self, tau: float) -> FloatArray:
        """Change of `exponential` with ln tau."""
        step = 1e-4
        up, down = self.exponential(tau * math.exp(step)), self.exponential(tau * math.exp(-step))
        result: FloatArray = (up - down) / (2.0 * step)
        return result

    def solve(self, taus: FloatArray, rho: float) -> tuple[FloatArray, float, float]:
        """Linear coefficients, s^2, and -2 ln L."""
        design = np.stack([np.ones_like(self.time), *map(self.exponential, taus)], axis=1)
        variance = 1.0 + rho * self.eigen
        white = 1.0 / np.sqrt(variance)
        A, b = (self.rotate @ design) * white[:, None], self.rotated * white
        found, *_ = np.linalg.lstsq(A, b, rcond=None)
        n = len(b)
        s2 = max(float(np.sum((b - A @ found) ** 2)) / n, 1e-300)
        return found, s2, n * math.log(s2) + float(np.log(variance).sum())


def _sinh_by(x: FloatArray) -> FloatArray:
    """sinh(x) / x, of x limited to where it means anything."""
    x = np.clip(x, 1e-6, 50.0)
    result: FloatArray = np.sinh(x) / x
    return result


def fit_transient(time_s: FloatArray, signal: FloatArray) -> Transient:
    """Transient of one output, shapes (n,); times are counted from switching on."""
    blocks = _Blocks(time_s, signal)
    span = float(time_s[-1] - time_s[0])
    best = _refined(blocks, _likeliest(blocks, [np.empty(0)]), span)
    for _ in range(2):
        starts = [np.append(best[0], t) for t in np.geomspace(span / 300.0, span, _TAUS)]
        more = _likeliest(blocks, starts)
        if best[2] - more[2] < _PROMISING:
            break
        more = _refined(blocks, more, span)
        if best[2] - more[2] < SIGNIFICANT:
            break
        best = more
    taus, rho, _ = best
    found, s2, _ = blocks.solve(taus, rho)
    covariance = _covariance(blocks, taus, rho, found, s2)
    order = np.argsort(taus)
    k = len(taus)
    pick = np.concatenate([order, k + order]).astype(np.int64)
    tail = time_s >= time_s[0] + 0.75 * span
    rest = np.exp(-time_s[tail, None] / taus) @ found[1:] if k else 0.0
    limit = 0.0
    if not k:
        shape = _covariance(blocks, np.array([span / 10.0]), rho, np.zeros(2), s2)
        limit = math.sqrt(SIGNIFICANT) * math.sqrt(float(shape[1, 1]))
    return Transient(
        taus[order],
        found[1:][order],
        covariance[np.ix_(pick, pick)],
        float(np.mean(signal[tail] - rest)),
        limit,
    )


Found = tuple[FloatArray, float, float]
"""Time constants, rho, and -2 ln L."""


def _likeliest(blocks: _Blocks, starts: list[FloatArray]) -> Found:
    """The best of several first guesses of the time constants, each with several rho."""
    return min(
        ((taus, rho, blocks.solve(taus, rho)[2]) for taus in starts for rho in _RHO),
        key=lambda item: item[2],
    )


def _refined(blocks: _Blocks, best: Found, span: float) -> Found:
    """Most probable time constants and rho near a first guess."""
    low, high = math.log(span / 3000.0), math.log(span * 3.0)

    def loss(p: FloatArray) -> float:
        if (p[:-1] < low).any() or (p[:-1] > high).any() or not -40.0 < p[-1] < 20.0:
            return math.inf
        return blocks.solve(np.exp(p[:-1]), math.exp(p[-1]))[2]

    start = np.log(np.append(best[0], best[1]))
    simplex = np.vstack([start, start + 0.3 * np.eye(len(start))])
    done = minimize(
        loss, start, method="Nelder-Mead",
        options={"initial_simplex": simplex, "xatol": 1e-3, "fatol": 1e-3, "maxfev": 400},
    )  # fmt: skip
    p = np.asarray(done.x if done.fun < best[2] else start)
    return np.exp(p[:-1]), math.exp(p[-1]), float(min(done.fun, best[2]))


def _covariance(
    blocks: _Blocks, taus: FloatArray, rho: float, found: FloatArray, s2: float
) -> FloatArray:
    """Of ln tau and A, (2 k, 2 k), with c among the unknowns."""
    k = len(taus)
    if not k:
        return np.zeros((0, 0))
    columns = [np.ones_like(blocks.time)]
    for tau, amplitude in zip(taus, found[1:], strict=True):
        columns.append(amplitude * blocks.slope(tau))
    columns += [blocks.exponential(tau) for tau in taus]
    white = 1.0 / np.sqrt(1.0 + rho * blocks.eigen)
    J = (blocks.rotate @ np.stack(columns, axis=1)) * white[:, None]
    n = len(blocks.time)
    unbiased = s2 * n / max(n - J.shape[1] - 2, 1)
    information = J.T @ J
    if not found[1:].any():  # amplitude 0: its time constant is not an unknown
        keep = [0, *range(1 + k, 1 + 2 * k)]
        full = np.zeros((1 + 2 * k, 1 + 2 * k))
        full[np.ix_(keep, keep)] = np.linalg.inv(information[np.ix_(keep, keep)])
    else:
        full = np.linalg.pinv(information, rcond=1e-14)
    result: FloatArray = unbiased * full[1:, 1:]
    return result
