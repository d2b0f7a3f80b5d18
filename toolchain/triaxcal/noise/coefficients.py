"""The five noise coefficients of IEEE 952 from the spectrum, with confidence intervals.

A sum of independent noises has the two-sided density and the Allan variance

    S(f)       = Q^2 dt (2 pi f)^2 + N^2 + B^2 / (2 pi f) + K^2 / (2 pi f)^2 + R^2 / (2 pi f)^3
    s^2(tau)   = 3 Q^2 / tau^2 + N^2 / tau + (2 ln 2 / pi) B^2 + K^2 tau / 3 + R^2 tau^2 / 2

(IEEE 952-1997, annex C; there R is a ramp. A ramp has no density; the f^-3 noise has ln tau beside
tau^2.) The ordinates of the spectrum are nearly independent and exponentially distributed, those of
the Allan deviation are neither. So the squares theta >= 0 of the coefficients maximise Whittle's
likelihood of the spectrum,

    L(theta) = - sum m / c (ln S + S_found / S),

m ordinates in a bin, c for their correlation; its score is solved by weighted least squares, again
and again. An interval holds all theta_k that lose at most 3.84 / 2 of ln L with the others fitted
(95 %, one degree of freedom). A coefficient whose interval begins at 0 is not determined: only its
upper limit is given.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from triaxcal.model.types import FloatArray
from triaxcal.noise.spectrum import CORRELATED, Spectrum

_LOSS = 3.841
"""95 % of chi^2 with one degree of freedom."""
_ROUNDS = 40
_HALVINGS = 14


@dataclass(frozen=True)
class NoiseKind:
    """One term of the density.

    Attributes
    ----------
    symbol, name : str
    unit : str
        Of the coefficient of a signal in g.
    power : int
        Of 2 pi f in the density.
    """

    symbol: str
    name: str
    unit: str
    power: int


KINDS = (
    NoiseKind("Q", "quantisation noise", "g s", 2),
    NoiseKind("N", "velocity random walk", "g sqrt(s)", 0),
    NoiseKind("B", "bias instability", "g", -1),
    NoiseKind("K", "acceleration random walk", "g/sqrt(s)", -2),
    NoiseKind("R", "ramp", "g/s", -3),
)


@dataclass(frozen=True)
class Coefficient:
    """One coefficient of a signal.

    Attributes
    ----------
    kind : NoiseKind
    value : float
        Most probable, in `kind.unit` with the signal's unit for g.
    low, high : float
        95 % interval; `low` is 0 where the coefficient is not determined, `high` then its limit.
    """

    kind: NoiseKind
    value: float
    low: float
    high: float

    @property
    def determined(self) -> bool:
        """Whether the signal shows that there is any."""
        return self.low > 0.0


def allan_variance(kind: NoiseKind, tau_s: FloatArray) -> FloatArray:
    """Allan variance of a coefficient of 1 at averaging times."""
    factors = {"Q": 3.0, "N": 1.0, "B": 2.0 * math.log(2.0) / math.pi, "K": 1 / 3, "R": 0.5}
    result: FloatArray = factors[kind.symbol] * tau_s ** float(-1 - kind.power)
    return result if kind.symbol != "Q" else factors["Q"] / tau_s**2


def coefficients(found: Spectrum) -> tuple[Coefficient, ...]:
    """All five, in the order of `KINDS`."""
    fit = _Fit(found)
    theta, best = fit.fitted(None, 0.0)
    result = []
    for k, kind in enumerate(KINDS):
        low = 0.0
        if theta[k] > 0.0 and fit.loss(k, 0.0, best) > _LOSS:
            low = fit.end(k, float(theta[k]), best, down=True)
        high = fit.end(k, float(theta[k]), best, down=False)
        result.append(Coefficient(kind, *(math.sqrt(v) for v in (float(theta[k]), low, high))))
    return tuple(result)


class _Fit:
    """Whittle's likelihood of one spectrum."""

    def __init__(self, found: Spectrum) -> None:
        shapes = [found.shape(kind.power) for kind in KINDS]
        shapes[0] = shapes[0] * found.step_s
        self.X = np.stack(shapes, axis=1)
        self.density = np.maximum(found.density, 1e-300)
        self.weight = found.count / CORRELATED

    def deviance(self, S: FloatArray) -> float:
        """-2 ln L."""
        return float(2.0 * (self.weight @ (np.log(S) + self.density / S)))

    def fitted(self, fixed: int | None, value: float) -> tuple[FloatArray, float]:
        """Squares of the coefficients, with one of them given, and the deviance."""
        free = [k for k in range(len(KINDS)) if k != fixed]
        given = np.zeros(len(self.density)) if fixed is None else value * self.X[:, fixed]
        S, theta = np.maximum(self.density, given), np.zeros(len(KINDS))
        if fixed is not None:
            theta[fixed] = value
        best, last = (theta, math.inf), math.inf
        for _ in range(_ROUNDS):
            root = np.sqrt(self.weight) / S
            A = root[:, None] * self.X[:, free]
            size = np.linalg.norm(A, axis=0)
            theta = theta.copy()
            theta[free] = nnls(A / size, root * (self.density - given), maxiter=200)[0] / size
            S = np.maximum(self.X @ theta, 1e-12 * self.density)
            now = self.deviance(S)
            if now < best[1]:
                best = theta, now
            if abs(now - last) < 1e-5:
                break
            last = now
        return best

    def loss(self, k: int, value: float, best: float) -> float:
        """How much the deviance rises with one square given."""
        return self.fitted(k, value)[1] - best

    def end(self, k: int, theta: float, best: float, *, down: bool) -> float:
        """End of the interval of one square."""
        A = np.sqrt(self.weight) * self.X[:, k] / self.density
        inside = theta or 0.1 / float(np.linalg.norm(A))
        factor = 0.5 if down else 2.0
        near, far = inside, inside * factor
        for _ in range(80):
            if self.loss(k, far, best) > _LOSS:
                break
            near, far = far, far * factor
        for _ in range(_HALVINGS):
            middle = math.sqrt(near * far)
            near, far = (near, middle) if self.loss(k, middle, best) > _LOSS else (middle, far)
        return math.sqrt(near * far)
