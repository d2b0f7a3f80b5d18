"""Whether the unit rests: several detectors, for none of them sees everything.

A variance sees shaking but neither slips nor creep; a slope sees creep, a step test slips. Blocks
of one second; the noise within a block and from block to block is learned from a reference at
rest (docs/how-to/bench.md has the thresholds and what they miss).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray
from triaxcal.rig.plan.plan import Stillness
from triaxcal.rig.session.blocks import Block
from triaxcal.rig.session.reasons import Reason, Why, because
from triaxcal.rig.session.rounding import (
    FLICKER,
    LEAST_VARIANCE,
    ONE_CODE,
    at_least,
    hides,
    rounding,
)


@dataclass(frozen=True)
class Reference:
    """Noise at rest, learned.

    Attributes
    ----------
    variance : tuple of three floats
        Of one reading, code^2.
    readings : int
        Readings behind it.
    block_variance : tuple of three floats
        Of the mean of a block, code^2, from the differences of neighbours.
    blocks : int
        Blocks behind it.
    """

    variance: tuple[float, float, float]
    readings: int
    block_variance: tuple[float, float, float]
    blocks: int


@dataclass(frozen=True)
class Average:
    """Mean of a dwell and its uncertainty.

    Attributes
    ----------
    mean_code, u_code, batch_sd_code : tuples of three floats
        Mean; its type A uncertainty; deviation of one batch mean with the Allan floor in it, so
        that u = batch_sd / sqrt(batches).
    """

    mean_code: tuple[float, float, float]
    u_code: tuple[float, float, float]
    batch_sd_code: tuple[float, float, float]
    batches: int
    readings: int


def make_reference(
    blocks: Sequence[Block], settings: Stillness, step_code: FloatArray = ONE_CODE
) -> Reference | int:
    """Noise of blocks at rest, or the place of the last block that moved among them."""
    variances = np.array([b.variance for b in blocks])
    median = at_least(np.median(variances, axis=0), step_code)
    limit = _moving_ratio(settings, blocks[0].count)
    moving = np.flatnonzero((variances > limit * median).any(axis=1))
    if len(moving):
        return int(moving[-1])
    pooled, readings = _pooled(blocks)
    return Reference(
        variance=_triple(pooled),
        readings=readings,
        block_variance=_triple(_neighbour_variance(_means(blocks))),
        blocks=len(blocks),
    )


def motion(
    block: Block,
    previous: Block | None,
    reference: Reference | None,
    settings: Stillness,
    micro_g_per_code: FloatArray,
    *,
    step_code: FloatArray = ONE_CODE,
) -> Reason | None:
    """Why a block is not at rest; None when it is."""
    if previous is not None and previous.index == block.index - 1:
        step = np.abs((block.mean - previous.mean) * micro_g_per_code)
        axis = int(np.argmax(step))
        if step[axis] > settings.moving_step_micro_g:
            return because(Why.MOVED, micro_g=float(step[axis]), axis=AXES[axis])
    if reference is not None:
        ratio = np.array(block.variance) / at_least(reference.variance, step_code)
        axis = int(np.argmax(ratio))
        if ratio[axis] > _moving_ratio(settings, block.count):
            return because(Why.SHAKEN, ratio=float(ratio[axis]), axis=AXES[axis])
    return None


_CREEP_TAU_S = (10.0, 20.0, 40.0)
"""Time constants that creep is looked for with; between two of them little is lost."""


def refusals(
    rest: Sequence[Block],
    dwell: slice,
    reference: Reference,
    settings: Stillness,
    micro_g_per_code: FloatArray,
    *,
    step_code: FloatArray = ONE_CODE,
) -> list[Reason]:
    """Why an average is not to be trusted; empty when it is.

    `rest` is the whole rest, `rest[dwell]` is averaged; what lies before and behind it is its
    guard: a slip near an end of the dwell shows against it.
    """
    scale = np.abs(micro_g_per_code)
    averaged = rest[dwell]
    noise = _noise_of_means(_means(rest), rest[0].count, reference, step_code)
    slip_t, slip = _slip(rest, dwell.start, noise, scale)
    creep_t, creep = _creep(rest, noise, scale)
    # Large creep looks like a step too, and a step like creep: the better fit gives the name.
    if creep_t > max(settings.creep_t, slip_t):
        found = [creep]
    elif slip_t > settings.slip_t:
        found = [slip]
    elif creep_t > settings.creep_t:
        found = [creep]
    else:
        found = _slope(averaged, settings, scale)
    found += _noise(averaged, reference, settings, step_code)
    u_micro_g = (
        np.array(average(averaged, settings, micro_g_per_code, step_code=step_code).u_code) * scale
    )
    axis = int(np.argmax(u_micro_g))
    if u_micro_g[axis] > settings.u_max_micro_g:
        limit = settings.u_max_micro_g
        u = float(u_micro_g[axis])
        found.append(because(Why.UNCERTAIN, axis=AXES[axis], micro_g=u, limit=limit))
    return found


def average(
    dwell: Sequence[Block],
    settings: Stillness,
    micro_g_per_code: FloatArray,
    *,
    step_code: FloatArray = ONE_CODE,
) -> Average:
    """Mean of a dwell, u(A) from batch means (GUM 4.2 with batches as the observations).

    Batches, because filtered samples are correlated: s / sqrt(n) would be far too small. What
    rounding leaves in the mean, where the noise is small against a step, is added in quadrature.
    """
    readings = sum(b.count for b in dwell)
    totals = [sum(b.total[axis] for b in dwell) for axis in range(3)]
    size = len(dwell) // settings.batches
    means = np.array(
        [
            [sum(b.total[axis] for b in part) / sum(b.count for b in part) for axis in range(3)]
            for part in (dwell[i * size : (i + 1) * size] for i in range(settings.batches))
        ]
    )
    floor = settings.allan_floor_micro_g / np.abs(micro_g_per_code)
    u_squared = np.var(means, axis=0, ddof=1) / settings.batches + floor**2
    u_squared += rounding(_pooled(dwell)[0], step_code)
    return Average(
        mean_code=_triple(np.array([total / readings for total in totals])),
        u_code=_triple(np.sqrt(u_squared)),
        batch_sd_code=_triple(np.sqrt(u_squared * settings.batches)),
        batches=settings.batches,
        readings=readings,
    )


def slope_micro_g_per_min(
    blocks: Sequence[Block], micro_g_per_code: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Slope of the means of three or more blocks and its t value, shapes (3,)."""
    t_s = np.array([b.index for b in blocks], np.float64)
    t_s -= t_s.mean()
    means = _means(blocks) * np.abs(micro_g_per_code)
    centred = means - means.mean(axis=0)
    slope = t_s @ centred / (t_s @ t_s)
    rest = centred - np.outer(t_s, slope)
    u = np.sqrt((rest**2).sum(axis=0) / max(len(blocks) - 2, 1) / (t_s @ t_s))
    return slope * 60.0, slope / np.maximum(u, np.finfo(float).tiny)


def _moving_ratio(settings: Stillness, count: int) -> float:
    """Limit of a block's variance ratio; sqrt(2 / (n - 1)) is the deviation of a variance."""
    return float(1.0 + settings.moving_sigma * np.sqrt(2.0 / max(count - 1, 1)))


def _slip(
    blocks: Sequence[Block], start: int, noise: FloatArray, scale: FloatArray
) -> tuple[float, Reason]:
    """The largest step between what lies before and after any moment: t value, and reason."""
    means = _means(blocks)
    n = len(means)
    if n < 4:
        return 0.0, because(Why.SLIP)
    sums = np.cumsum(means - means[0], axis=0)
    # Two blocks at least on either side: one alone is the motion detector's business.
    split = np.arange(2, n - 1)
    left = sums[split - 1] / split[:, None]
    right = (sums[-1] - sums[split - 1]) / (n - split)[:, None]
    t = np.abs(right - left) / np.sqrt(noise * (1.0 / split + 1.0 / (n - split))[:, None])
    at, axis = np.unravel_index(int(np.argmax(t)), t.shape)
    size = abs(right[at, axis] - left[at, axis]) * scale[axis]
    at_s = int(split[at]) - start
    slip = because(Why.SLIP, micro_g=float(size), axis=AXES[axis], at_s=at_s)
    return float(t[at, axis]), slip


def _creep(rest: Sequence[Block], noise: FloatArray, scale: FloatArray) -> tuple[float, Reason]:
    """What settles exponentially since the unit was left alone: t value, and reason.

    The best test there is for a known form in white noise is its correlation with that form
    (matched filter); a straight line finds a tenth of it.
    """
    means = _means(rest)
    t_s = np.array([b.index - rest[0].index for b in rest], np.float64) + 0.5
    best = (0.0, 0, 0.0, 0.0)
    for tau_s in _CREEP_TAU_S:
        form = np.exp(-t_s / tau_s)
        form -= form.mean()
        squares = float(form @ form)
        size = form @ means / squares
        t = np.abs(size) * np.sqrt(squares / noise)
        axis = int(np.argmax(t))
        best = max(best, (float(t[axis]), axis, float(abs(size[axis]) * scale[axis]), tau_s))
    t_value, axis, micro_g, tau_s = best
    return t_value, because(Why.SETTLING, micro_g=micro_g, tau_s=tau_s, axis=AXES[axis])


def _slope(dwell: Sequence[Block], settings: Stillness, scale: FloatArray) -> list[Reason]:
    slope, t = slope_micro_g_per_min(dwell, scale)
    axis = int(np.argmax(np.abs(t)))
    if abs(t[axis]) <= settings.slope_t:
        return []
    return [because(Why.CREEP, micro_g_per_min=float(slope[axis]), axis=AXES[axis])]


def _noise(
    dwell: Sequence[Block], reference: Reference, settings: Stillness, step_code: FloatArray
) -> list[Reason]:
    pooled, readings = _pooled(dwell)
    ratio = pooled / at_least(reference.variance, step_code)
    limit = 1.0 + settings.noise_sigma * np.sqrt(2.0 / readings + 2.0 / reference.readings)
    axis = int(np.argmax(ratio))
    if ratio[axis] > limit:
        return [because(Why.NOISE, ratio=float(ratio[axis]), axis=AXES[axis])]
    return []


def _noise_of_means(
    means: FloatArray, count: int, reference: Reference, step_code: FloatArray
) -> FloatArray:
    """Variance of a block's mean, of these and of the reference together, shape (3,)."""
    n = len(means)
    shared = np.array(reference.block_variance) * reference.blocks
    found = (_neighbour_variance(means) * n + shared) / (n + reference.blocks)
    hidden = hides(np.array(reference.variance), step_code)
    least = np.where(hidden, FLICKER / count * step_code**2, LEAST_VARIANCE)
    noise: FloatArray = np.maximum(found, np.maximum(least, LEAST_VARIANCE))
    return noise


def _means(blocks: Sequence[Block]) -> FloatArray:
    return np.array([b.mean for b in blocks])


def _pooled(blocks: Sequence[Block]) -> tuple[FloatArray, int]:
    """Pooled variance of one reading, shape (3,), and its degrees of freedom."""
    weights = np.array([b.count - 1 for b in blocks], np.float64)
    pooled = weights @ np.array([b.variance for b in blocks]) / weights.sum()
    return np.asarray(pooled, np.float64), int(weights.sum())


def _neighbour_variance(means: FloatArray) -> FloatArray:
    """Variance of a block mean from the differences of neighbours (von Neumann).

    A slip, creep or drift hardly enters.
    """
    differences = np.diff(means, axis=0)
    return np.asarray((differences**2).sum(axis=0) / (2.0 * len(differences)), np.float64)


def _triple(values: FloatArray) -> tuple[float, float, float]:
    return (float(values[0]), float(values[1]), float(values[2]))
