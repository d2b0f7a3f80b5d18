"""The evidence of a hypothesis on poses: quickly for all places, carefully for the best ones.

A sound unit is the fit with all terms and [priors] (`fitting.recorded`), its noise integrated out.
A hypothesis has amplitudes besides, or other poses, priors or noise.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from triaxcal.diagnosis.core.evidence import FAULT_LOG_ODDS
from triaxcal.diagnosis.poses.core.cause import PoseHypothesis
from triaxcal.diagnosis.poses.core.readings import PoseReadings
from triaxcal.fitting.core.noise import Linearised, noise_of
from triaxcal.fitting.core.posterior import Posterior, Prior, fit_map
from triaxcal.fitting.recorded.prior import FULL, Known
from triaxcal.fitting.recorded.scalar import ScalarData, residual_of
from triaxcal.model.types import BoolArray, FloatArray

_SMALL = 1e-5


@dataclass(frozen=True)
class SoundPoses:
    """What is known of a sound unit.

    Attributes
    ----------
    known : Known
        In units of g.
    basis : array, shape (n, P)
        Functions of temperature at the poses.
    gain_functions : int
        How many of them the entries of K have.
    """

    known: Known
    basis: FloatArray
    gain_functions: int

    def data(self, readings: PoseReadings) -> ScalarData:
        """Poses as the fit takes them."""
        return ScalarData(
            readings.outputs,
            self.basis,
            readings.weight,
            readings.gravity_g,
            np.zeros(3),
            readings.one_g,
            readings.count,
        )

    def residual(self, readings: PoseReadings, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """|a| - g (n,) and its derivatives (n, parameters)."""
        both = residual_of(FULL, self.gain_functions, self.data(readings), theta)
        return both[0] - readings.longer_g, both[1]

    def prior(self, readings: PoseReadings) -> Prior:
        """Of the constants."""
        return self.known.of(FULL, self.data(readings), self.gain_functions)


@dataclass(frozen=True)
class JudgedPoses:
    """A hypothesis and how well it explains the poses.

    Attributes
    ----------
    log_evidence : float
        With what makes its place and cause improbable beforehand.
    log_likelihood : float
        Of the poses alone, whatever the number of places.
    amplitudes, sd : arrays, shape (k,)
    held_out_g : float
        Rms of |a| - g, each pose that is used held out in turn.
    """

    hypothesis: PoseHypothesis
    log_evidence: float
    log_likelihood: float
    amplitudes: FloatArray
    sd: FloatArray
    held_out_g: float


def log_prior(hypothesis: PoseHypothesis) -> float:
    """Of one place of one cause, against a sound unit."""
    return FAULT_LOG_ODDS + hypothesis.log_prior - math.log(hypothesis.places)


def judge(hypothesis: PoseHypothesis, readings: PoseReadings, sound: SoundPoses) -> JudgedPoses:
    """Evidence of a hypothesis, whatever the size of its effect."""
    if hypothesis.priors is not None:
        sound = replace(sound, known=replace(sound.known, priors=hypothesis.priors))
    sizes = hypothesis.sizes if hypothesis.parameters else (1.0,)
    fits = [fit_of(hypothesis, readings, sound, size) for size in sizes]
    best = max(fits, key=lambda fit: fit.log_evidence)
    total = float(np.logaddexp.reduce([f.log_evidence for f in fits])) - math.log(len(fits))
    total += _explained(hypothesis, readings)
    k = len(hypothesis.parameters)
    first = len(best.theta) - k
    sd = np.sqrt(np.diag(best.spread_covariance)[first:])
    return JudgedPoses(
        hypothesis,
        total + log_prior(hypothesis),
        total,
        best.theta[first:],
        sd,
        _held_out(best, readings, sound, hypothesis),
    )


def _explained(hypothesis: PoseHypothesis, readings: PoseReadings) -> float:
    """Ln of the probability of the poses that the cause itself explains, as the fit counts it."""
    if hypothesis.unused is None:
        return 0.0
    count, weight = readings.count[hypothesis.unused], readings.weight[hypothesis.unused]
    own = np.log(weight / np.sqrt(count))
    each = math.log(hypothesis.density_per_g) + 0.5 * math.log(2.0 * math.pi) - own
    return float((count * each).sum())


def fit_of(
    hypothesis: PoseHypothesis, readings: PoseReadings, sound: SoundPoses, size: float = 1.0
) -> Posterior:
    """Most probable constants and amplitudes, these of one prior standard deviation."""
    used = np.ones(len(readings), dtype=np.bool_)
    if hypothesis.unused is not None:
        used = ~hypothesis.unused
    own = sound.prior(readings)
    p, k = len(own.mean), len(hypothesis.parameters)
    factor = np.zeros((p + k, own.factor.shape[1] + k))
    factor[:p, : own.factor.shape[1]] = own.factor
    factor[p:, own.factor.shape[1] :] = size * np.eye(k)
    prior = Prior(np.concatenate([own.mean, np.zeros(k)]), factor)

    def model(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        return _residual(hypothesis, readings, sound, theta)

    return fit_map(
        model,
        prior,
        readings.weight * used,
        hypothesis.noise or sound.known.noise,
        values=float(readings.count[used].sum()),
    )


def _residual(
    hypothesis: PoseHypothesis, readings: PoseReadings, sound: SoundPoses, theta: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Residuals of the mended poses, and their derivatives by constants and amplitudes."""
    k = len(hypothesis.parameters)
    own, about = theta[: len(theta) - k], theta[len(theta) - k :]
    residual, slopes = sound.residual(hypothesis.undo(readings, about), own)
    if not k:
        return residual, slopes
    columns = []
    for step in _SMALL * np.eye(k):
        moved = sound.residual(hypothesis.undo(readings, about + step), own)[0]
        columns.append((moved - residual) / _SMALL)
    return residual, np.column_stack([slopes, *columns])


def _held_out(
    fit: Posterior, readings: PoseReadings, sound: SoundPoses, hypothesis: PoseHypothesis
) -> float:
    """By the leverage of each pose, about the solution."""
    used = fit.weight > 0.0
    if not used.any():
        return math.nan
    residual, slopes = _residual(hypothesis, readings, sound, fit.theta)
    B = (fit.weight[:, None] * (slopes @ fit.prior.factor))[used]
    A = B.T @ B
    A.flat[:: len(A) + 1] += fit.scale**2
    leverage = (B * np.linalg.solve(A, B.T).T).sum(axis=1)
    # A pose that one constant, or one amplitude, is about alone says nothing held out.
    tested = (leverage < 1.0 - _SMALL) & ~_of_one_pose(slopes, hypothesis)[used]
    left = residual[used][tested] / (1.0 - leverage[tested])
    return float(np.sqrt(np.mean(left**2))) if tested.any() else math.nan


def _of_one_pose(slopes: FloatArray, hypothesis: PoseHypothesis) -> BoolArray:
    """Poses that have an amplitude of their own, (n,): the others say nothing of it."""
    moved = slopes[:, slopes.shape[1] - len(hypothesis.parameters) :] != 0.0
    found: BoolArray = moved[:, moved.sum(axis=0) == 1].any(axis=1)
    return found


@dataclass(frozen=True)
class ScreenedPoses:
    """A hypothesis with its quick evidence; judged with care where it has no amplitudes."""

    hypothesis: PoseHypothesis
    log_evidence: float
    judged: JudgedPoses | None = None


class Quick:
    """Evidence of many hypotheses whose amplitudes are taken as small."""

    def __init__(self, readings: PoseReadings, sound: SoundPoses, fit: Posterior) -> None:
        self.readings, self.sound, self.fit = readings, sound, fit
        residual, slopes = sound.residual(readings, fit.theta)
        self._B = readings.weight[:, None] * (slopes @ fit.prior.factor)
        at_mean = residual - slopes @ (fit.theta - fit.prior.mean)
        self._y = readings.weight * at_mean

    def best(self, hypotheses: Iterable[PoseHypothesis], most: int) -> list[ScreenedPoses]:
        """The most probable of some hypotheses, the best first."""
        scored = [self._score(h) for h in hypotheses]
        return sorted(scored, key=lambda s: -s.log_evidence)[:most]

    def careful(self, screened: ScreenedPoses) -> JudgedPoses:
        """Evidence whatever the size of the effect."""
        return screened.judged or judge(screened.hypothesis, self.readings, self.sound)

    def _score(self, hypothesis: PoseHypothesis) -> ScreenedPoses:
        if not hypothesis.parameters:
            judged = judge(hypothesis, self.readings, self.sound)
            return ScreenedPoses(hypothesis, judged.log_evidence, judged)
        theta = np.concatenate([self.fit.theta, np.zeros(len(hypothesis.parameters))])
        slopes = _residual(hypothesis, self.readings, self.sound, theta)[1]
        columns = self.readings.weight[:, None] * slopes[:, len(self.fit.theta) :]
        values, each = float(self.readings.count.sum()), []
        for size in hypothesis.sizes:
            at = Linearised.about(np.hstack([self._B, size * columns]), self._y, values)
            each.append(noise_of(at, self.sound.known.noise).log_evidence)
        total = float(np.logaddexp.reduce(each)) - math.log(len(each))
        return ScreenedPoses(hypothesis, total + log_prior(hypothesis))
