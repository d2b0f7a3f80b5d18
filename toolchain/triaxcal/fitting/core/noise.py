"""The noise scale of a linearised problem: its marginal likelihood on a grid of ln s."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from triaxcal.model.types import FloatArray

_NOISE_MAX = 1.0
_NODES = 90


@dataclass(frozen=True)
class NoisePrior:
    """What is known of the noise of a value of weight 1 beforehand: log-normal.

    Real recordings of poses have 0.25 to 1 mg where the sensor lay still, and 3 to 7 mg where a
    hand held it: an interval about too small a noise holds the truth too seldom.

    Attributes
    ----------
    median : float
    spread : float
        Standard deviation of ln s.
    least : float
        It is not below this.
    """

    median: float = 1e-3
    spread: float = 1.2
    least: float = 1e-4

    def beside(self, sd: float) -> NoisePrior:
        """Of a value that has a known scatter of its own beside this noise."""
        return replace(self, median=math.hypot(self.median, sd))

    def log_density(self, nodes: FloatArray) -> FloatArray:
        """At each ln s."""
        result: FloatArray = -0.5 * ((nodes - math.log(self.median)) / self.spread) ** 2
        return result - math.log(self.spread * math.sqrt(2.0 * math.pi))


NOISE = NoisePrior()


@dataclass(frozen=True)
class Linearised:
    """The problem about one z: |y + B z|^2, through the singular values of B.

    Attributes
    ----------
    singular : array, shape (k,)
        b, 0 where no reading sees the direction.
    vectors : array, shape (k, k)
        E, a column each.
    along : array, shape (k,)
        y along the left singular vectors.
    rest : float
        Square of what is left of y.
    values : float
        Sum of the squared weights: how many values there are.
    """

    singular: FloatArray
    vectors: FloatArray
    along: FloatArray
    rest: float
    values: float

    @staticmethod
    def about(B: FloatArray, y: FloatArray, values: float) -> Linearised:
        """Through the triangle of [B y], so that many rows cost one pass."""
        k = B.shape[1]
        R: FloatArray = np.column_stack([B, y])
        if len(R) > k:
            R = np.asarray(np.linalg.qr(R, mode="r"), dtype=np.float64)
        top = R[:k, :k]
        left, singular, right = np.linalg.svd(top)
        count = len(singular)
        padded, along = np.zeros(k), np.zeros(k)
        padded[:count] = singular
        projected = left.T @ R[: len(top), k]
        along[:count] = projected[:count]
        rest = float((projected[count:] ** 2).sum() + (R[len(top) :, k] ** 2).sum())
        return Linearised(padded, right.T, along, rest, values)

    def log_likelihood(self, nodes: FloatArray) -> FloatArray:
        """Ln of the marginal likelihood at each ln s, but for a constant of the weights."""
        seen = self.singular > 0.0
        square = np.exp(2.0 * nodes)[:, None]
        both = square + self.singular[seen] ** 2
        quadratic = self.rest / square[:, 0] + (self.along[seen] ** 2 / both).sum(axis=1)
        powers = (self.values - seen.sum()) * 2.0 * nodes + np.log(both).sum(axis=1)
        result: FloatArray = -0.5 * (powers + quadratic)
        return result

    def best(self, scale: float) -> FloatArray:
        """The z that minimises |y + B z|^2 / s^2 + |z|^2."""
        shrunk = self.singular * self.along / (scale**2 + self.singular**2)
        result: FloatArray = -self.vectors @ shrunk
        return result


@dataclass(frozen=True)
class NoiseKnown:
    """What is known of ln s: nodes, their probabilities, mean and variance, and the evidence."""

    nodes: FloatArray
    share: FloatArray
    mean: float
    variance: float
    log_evidence: float

    def half_width(self) -> float:
        """Half the 95 % interval of such a noise, in units of exp(mean)."""
        kept = self.share > 1e-6
        scales: list[float] = np.exp(self.nodes[kept] - self.mean).tolist()
        parts = list(zip(self.share[kept].tolist(), scales, strict=True))
        low, high = 0.0, 6.0 * max(scales)
        total = math.fsum(p for p, _ in parts)
        for _ in range(40):
            middle = 0.5 * (low + high)
            inside = math.fsum(p * math.erf(middle / s / math.sqrt(2.0)) for p, s in parts)
            low, high = (middle, high) if inside < 0.95 * total else (low, middle)
        return 0.5 * (low + high)

    @property
    def dof(self) -> float:
        """Those of a scale estimate whose logarithm has this variance: trigamma(dof / 2) / 4."""
        low, high = 0.5, 1e7
        for _ in range(60):
            middle = math.sqrt(low * high)
            larger = trigamma(middle / 2.0) / 4.0 > self.variance
            low, high = (middle, high) if larger else (low, middle)
        return max(math.sqrt(low * high), 1.0)


def noise_of(at: Linearised, noise: NoisePrior) -> NoiseKnown:
    """What the data and the prior say of the noise."""
    low, high = math.log(noise.least), math.log(_NOISE_MAX)
    for _ in range(2):
        nodes = np.linspace(low, high, _NODES)
        log = at.log_likelihood(nodes) + noise.log_density(nodes)
        top = float(log.max())
        share = np.exp(log - top)
        total = float(share.sum())
        share /= total
        mean = float(share @ nodes)
        variance = float(share @ (nodes - mean) ** 2)
        step = (high - low) / (_NODES - 1)
        # Again about the mean, with nodes as near to each other as many data ask for.
        reach = 6.0 * max(math.sqrt(variance), step)
        low, high = max(low, mean - reach), min(high, mean + reach)
    return NoiseKnown(nodes, share, mean, variance, top + math.log(total * step))


def trigamma(x: float) -> float:
    """Second derivative of ln gamma: recurrence and asymptotic series (DLMF 5.15.8)."""
    total: float = 0.0
    while x < 20.0:
        total += 1.0 / (x * x)
        x += 1.0
    result: float = total + 1.0 / x + 0.5 / (x * x) + 1.0 / (6.0 * x * x * x)
    return result
