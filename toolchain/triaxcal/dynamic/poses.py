"""The accelerometers by the rests alone: |a| = g, without gyros; P2 (1) with (2) left out.

At rest the force is as large as gravity, whatever the attitude, so that nine constants follow from
nine rests in different attitudes: df0 and the lower triangular Gamma, by which the instrument's
axes are those of P2. With a = (1 + Gamma)^-1 (f' - df0) and u = a/|a|,

    d|a| / d df0 = -u^T (1 + Gamma)^-1,    d|a| / d Gamma_ij = -(u^T (1 + Gamma)^-1)_i a_j.

Sizes are averaged, not forces: the hand that holds the unit may lean. Noise of the deviation s of
each axis makes a size larger by s^2/g on average, which is taken off.

The solution is where the passes of the filter begin, and what their result is compared with: the
filter relates the rests by the gyros as well, and must not disagree with the rests.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.accelerated import (
    OUTLIER_M_PER_S2,
    never_at_rest,
    refuse_shaken,
    rest_tolerance,
)
from triaxcal.dynamic.blocks.base import ACCELEROMETER_BIAS, ACCELEROMETER_MATRIX, LOWER
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.dynamic.survey import Survey
from triaxcal.dynamic.window import gamma_matrix, inverse_of_one_plus
from triaxcal.dynamic.windows import WINDOW_S
from triaxcal.model.types import BoolArray, FloatArray, IntArray

LAYOUT = Layout((ACCELEROMETER_BIAS, ACCELEROMETER_MATRIX))
DETERMINED = 0.01
"""Of the prior's deviation: constants that the rests know so well are worth beginning with."""
STEPS = 20
HALVINGS = 10
OUTLIER_SD = 6.0
"""Of the stated noise of a rest, and of the scatter of the others: by noise alone a residual was at
most 5.4 of its deviations in 1700 simulated recordings of 18 to 45 rests."""
RESTS_MIN = 2 * len(LAYOUT)
"""With fewer, one that is wrong bends the constants instead of standing out."""
SMALL_M_PER_S2 = 1e-3
"""Residuals below count as equal: an absolute value has no slope at zero."""
MOST_LEFT_OUT = 0.1
"""Of the rests: when more contradict the others, it is not known which are right."""


@dataclass(frozen=True)
class StaticPoses:
    """What the rests alone say of the accelerometers.

    Attributes
    ----------
    p, covariance : arrays, shapes (9,), (9, 9)
        df0 and Gamma by rows of the lower triangle, SI; the covariance by the stated noise, or by
        the scatter of the rests where that is larger.
    names : tuple of str
    left_out : tuple of float
        Starts of the rests that contradict the others, s.
    """

    p: FloatArray
    covariance: FloatArray
    names: tuple[str, ...]
    left_out: tuple[float, ...]

    @property
    def sd(self) -> FloatArray:
        """Standard deviations, shape (9,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def determined(self) -> bool:
        """Whether the rests alone know all nine constants."""
        return bool((self.sd < DETERMINED * LAYOUT.prior_sd).all())


@dataclass(frozen=True)
class StaticComparison:
    """The joint solution against that of the rests alone.

    Attributes
    ----------
    names : tuple of str
        Of the nine constants of the accelerometers.
    normalised : array, shape (9,)
        Joint less static, over the larger deviation of the two: the rests are part of the joint
        solution, so that a sound recording stays below a normal number of unit deviation.
    left_out : tuple of float
        Starts of the rests that contradict the others, s.
    determined : bool
        Whether the rests alone know all nine, and are described by them alone: with further effects
        on the forces, as of temperature, the joint constants are not those of a mean rest.
    """

    names: tuple[str, ...]
    normalised: FloatArray
    left_out: tuple[float, ...]
    determined: bool

    @property
    def largest(self) -> tuple[str, float]:
        """Name and normalised difference of the constant that disagrees most."""
        worst = int(np.argmax(np.abs(self.normalised)))
        return self.names[worst], float(self.normalised[worst])


def static_poses(recording: ImuRecording, found: Survey, noise: DataSheet) -> StaticPoses:
    """Constants of the accelerometers by the rests alone.

    Raises
    ------
    RefusedError
        When the rests shake, or contradict each other: by more than a few, or at the start.
    """
    stated = _variance(noise, recording, 1 / recording.rate_hz) ** 0.5
    refuse_shaken(recording.name, [rest.force_scatter for rest in found.rests], stated)
    gravity = recording.gravity_m_per_s2
    variance = [_variance(noise, recording, rest.duration_s) for rest in found.rests]
    window = _variance(noise, recording, WINDOW_S)
    sd = np.sqrt(variance)
    rests = _Forces.of(found, window / gravity)
    # The least sum of absolute residuals goes through nine rests: of few rests the median residual
    # is far below the noise.
    tolerance = max(rest_tolerance(recording), OUTLIER_SD * float(np.median(sd)))
    keep = _refused_or_kept(recording, found, rests, tolerance)
    p, covariance = _solved(rests, keep / sd, gravity)
    residual = rests.sizes(p) - gravity
    freedom = max(1, int(keep.sum()) - len(p))
    scatter = float(np.sqrt(((residual / sd)[keep] ** 2).sum() / freedom))
    rms = float(np.sqrt((residual[keep] ** 2).sum() / freedom))
    if keep.sum() >= RESTS_MIN and scatter > OUTLIER_SD and rms > tolerance:
        raise never_at_rest(recording.name, int(keep.sum()), rms)
    names = tuple(state.name for state in LAYOUT.states)
    left_out = tuple(found.rests[k].start_s for k in np.flatnonzero(~keep))
    covariance = covariance * max(1.0, scatter) ** 2
    return StaticPoses(p, covariance, names, left_out)


def compared(
    static: StaticPoses, layout: Layout, p: FloatArray, sd: FloatArray
) -> StaticComparison:
    """The joint solution, constants and deviations (n,) of `layout`, against the rests alone."""
    plain = [block.name for block, _ in layout.columns("force")] == [b.name for b in LAYOUT.blocks]
    n = len(static.p)
    normalised = (p[:n] - static.p) / np.maximum(static.sd, sd[:n])
    determined = plain and static.determined
    return StaticComparison(static.names, normalised, static.left_out, determined)


def _variance(noise: DataSheet, recording: ImuRecording, duration_s: float) -> float:
    """Of a mean over so long, (m/s^2)^2."""
    samples = max(1, round(duration_s * recording.rate_hz))
    return noise.mean_force_variance(duration_s, samples, recording.force_convention)


@dataclass(frozen=True)
class _Forces:
    """Mean forces of the windows of all rests.

    Attributes
    ----------
    force, weight : arrays, shapes (w, 3), (w,)
        The weights of a rest add up to one.
    starts : array, shape (n,)
        First window of each rest.
    longer : float
        What noise adds to a size, m/s^2.
    """

    force: FloatArray
    weight: FloatArray
    starts: IntArray
    longer: float

    @classmethod
    def of(cls, found: Survey, longer: float) -> _Forces:
        parts = [np.arange(rest.first, rest.end) for rest in found.rests]
        lengths = [found.windows.duration_s[part] for part in parts]
        weights = np.concatenate([length / length.sum() for length in lengths])
        starts = np.cumsum([0, *(len(part) for part in parts[:-1])])
        return cls(found.windows.force[np.concatenate(parts)], weights, starts, longer)

    def means(self, values: FloatArray) -> FloatArray:
        """Of each rest, of `values` (w, ...)."""
        weighted = values * (self.weight[:, None] if values.ndim > 1 else self.weight)
        means: FloatArray = np.add.reduceat(weighted, self.starts, axis=0)
        return means

    def corrected(self, p: FloatArray) -> tuple[FloatArray, FloatArray]:
        """a (w, 3), and (1 + Gamma)^-1."""
        inverse = inverse_of_one_plus(gamma_matrix(p[3:]))
        return (self.force - p[:3]) @ inverse.T, inverse

    def sizes(self, p: FloatArray) -> FloatArray:
        """Mean |a| of each rest, shape (n,), m/s^2."""
        return self.means(np.linalg.norm(self.corrected(p)[0], axis=1)) - self.longer


def _solved(rests: _Forces, weight: FloatArray, gravity: float) -> tuple[FloatArray, FloatArray]:
    """Constants (9,) and covariance, by Gauss-Newton with the priors of the filter.

    On a table the rests leave some constants almost free, and whole steps may run away along them:
    a step is halved until it makes the sum of squares smaller.
    """
    prior = 1 / LAYOUT.prior_sd
    p = np.zeros(len(LAYOUT))
    for _ in range(STEPS):
        a, inverse = rests.corrected(p)
        across = (a / np.linalg.norm(a, axis=1)[:, None]) @ inverse
        slopes = [across, *(across[:, [i]] * a[:, [j]] for i, j in LOWER)]
        own = rests.means(np.concatenate(slopes, axis=1)) * weight[:, None]
        rows = np.concatenate([own, np.diag(prior)])
        rest = np.concatenate([(rests.sizes(p) - gravity) * weight, -p * prior])
        step = np.linalg.lstsq(rows, rest, rcond=None)[0]
        for _ in range(HALVINGS):
            tried = np.r_[(rests.sizes(p + step) - gravity) * weight, -(p + step) * prior]
            if tried @ tried <= rest @ rest:
                p = p + step
                break
            step = step / 2
        root = np.linalg.inv(np.linalg.qr(rows, mode="r"))
        covariance: FloatArray = root @ root.T
        if (np.abs(step) < 1e-4 * np.sqrt(np.diag(covariance))).all():
            break
    return p, covariance


def _refused_or_kept(
    recording: ImuRecording, found: Survey, rests: _Forces, tolerance: float
) -> BoolArray:
    """Rests, shape (n,), that do not contradict the others by more than `tolerance`, m/s^2.

    By the least sum of absolute residuals, in which every rest has one vote: a long one that is
    wrong would pull a sum of squares to itself.
    """
    count = len(found.rests)
    keep = np.ones(count, dtype=bool)
    if count < RESTS_MIN:
        return keep
    gravity = recording.gravity_m_per_s2
    residual = np.full(count, OUTLIER_M_PER_S2)
    for _ in range(STEPS):
        weight = 1 / np.sqrt(np.maximum(np.abs(residual), SMALL_M_PER_S2) * SMALL_M_PER_S2)
        residual = rests.sizes(_solved(rests, weight, gravity)[0]) - gravity
    size = np.abs(residual)
    usual = 1.4826 * float(np.median(size))
    keep[:] = size < max(tolerance, OUTLIER_SD * usual)
    firsts = {section.start_s for section in found.sections}
    begins = np.array([rest.start_s in firsts for rest in found.rests])
    many = int((~keep).sum()) > MOST_LEFT_OUT * count
    if many or (begins & ~keep).any():
        worst = int(np.argmax(size * (begins | many) * ~keep))
        raise RefusedError(
            f"{recording.name}, {found.rests[worst].start_s:.1f} s",
            f"the force of this rest is {residual[worst]:+.3f} m/s^2 off gravity by the "
            "others: the unit was accelerated",
            expected="rests on something that does not move",
            remedy="record where nothing drives, swings or is leaned on",
        )
    return keep
