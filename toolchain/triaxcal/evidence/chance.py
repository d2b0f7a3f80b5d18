"""Tests against chance: of innovations, of held-out rests and turns, of the rate of the Earth."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.stats import chi2

from triaxcal.base.screentext import counted
from triaxcal.dynamic.blocks.base import DEG_PER_H
from triaxcal.dynamic.calibrate import DynamicResult
from triaxcal.dynamic.limits import ImuLimits
from triaxcal.dynamic.missing import Effect
from triaxcal.evidence.check import MODEL_TOLERANCE, SHARE, Check
from triaxcal.evidence.heldout import HeldOut
from triaxcal.evidence.prediction import LENGTH, ROWS
from triaxcal.model.types import BoolArray, FloatArray
from triaxcal.unit.site import EARTH_RATE_DEG_PER_H, STANDARD_GRAVITY_M_PER_S2

MOVES_SD = 1.96
"""An effect that is off matters where it moves a constant out of its own 95 % interval."""
LESS_NOISE = 0.5
"""Mean square of the innovations: below it the stated noise is too large, and so is every standard
deviation."""


INNOVATIONS, HELD_OUT_RESTS, HELD_OUT_TURNS = "innovations", "held-out rests", "held-out turns"
EFFECTS_OFF = "effects that are off"
EXPLAINED = frozenset({INNOVATIONS, HELD_OUT_RESTS, HELD_OUT_TURNS, EFFECTS_OFF})
"""Tests for whose failure a cause is looked for."""


def largest(freedom: int) -> float:
    """Limit of a chi-square: exceeded by chance in `SHARE` of all cases, with the tolerance."""
    return float((1 + MODEL_TOLERANCE) * chi2.isf(SHARE, freedom))


def innovations(result: DynamicResult) -> Check:
    """Mean square of the innovations against the stated noise."""
    last = result.passes[-1]
    limit = largest(last.freedom)
    times = math.sqrt(last.chi_square / last.freedom)
    most = math.sqrt(limit / last.freedom)
    return Check(
        INNOVATIONS, last.chi_square <= limit,
        f"{times:.2f} times the stated noise (limit {most:.2f})",
        last.chi_square, limit, "", last.freedom,
    )  # fmt: skip


def innovation_words(result: DynamicResult) -> str:
    """How large the innovations are, in words."""
    last = result.passes[-1]
    return f"innovations {math.sqrt(last.chi_square / last.freedom):.2f} times the stated noise"


def less_noise(result: DynamicResult) -> tuple[str, ...]:
    """That the stated noise is too large, in words."""
    last = result.passes[-1]
    ratio = last.chi_square / last.freedom
    if ratio >= LESS_NOISE:
        return ()
    times = f"{math.sqrt(ratio):.2g} times the stated noise"
    return (f"the innovations are {times}: [noise] states too much, and the tests show too little",)


def stacked(held: HeldOut) -> tuple[FloatArray, FloatArray]:
    """All predictions less what was measured, shape (5 k,), and their covariance."""
    y = np.concatenate([s.y for s in held.stretches])
    J = np.concatenate([s.J for s in held.stretches])
    covariance = J @ held.covariance @ J.T
    for k, s in enumerate(held.stretches):
        own = slice(ROWS * k, ROWS * (k + 1))
        covariance[own, own] += s.noise
    return y, covariance


def lengths(y: FloatArray) -> BoolArray:
    """Which of the stacked values are |a| - g."""
    which: BoolArray = np.arange(len(y)) % ROWS == LENGTH
    return which


def chi_square(y: FloatArray, covariance: FloatArray, which: BoolArray) -> float:
    """Of some of the stacked values."""
    return float(y[which] @ np.linalg.solve(covariance[np.ix_(which, which)], y[which]))


def held_out_checks(held: HeldOut, limits: ImuLimits) -> Iterator[Check]:
    """Held-out rests and turns, by chance and by the limits."""
    y, covariance = stacked(held)
    sd = np.sqrt(np.diag(covariance))
    rest, turn = lengths(y), ~lengths(y)
    yield _rests(y[rest], sd[rest], chi_square(y, covariance, rest))
    angle = np.linalg.norm(y[turn].reshape(-1, 2), axis=1)
    angle_sd = np.sqrt((sd[turn].reshape(-1, 2) ** 2).mean(axis=1))
    yield _turns(np.degrees(angle), np.degrees(angle_sd), chi_square(y, covariance, turn))
    yield from _demanded(np.abs(y[rest]) / STANDARD_GRAVITY_M_PER_S2, np.degrees(angle), limits)


def _rests(error: FloatArray, sd: FloatArray, value: float) -> Check:
    """| |a| - g |, m/s^2."""
    limit, worst = largest(len(error)), int(np.argmax(np.abs(error) / sd))
    size, its = (
        abs(error[worst]) / STANDARD_GRAVITY_M_PER_S2 * 1e6,
        sd[worst] / STANDARD_GRAVITY_M_PER_S2 * 1e6,
    )
    return Check(
        HELD_OUT_RESTS, value <= limit,
        f"|a| - g of {counted(len(error), 'rest')}: {size:.3g} micro-g at the worst, where "
        f"{its:.3g} is the predicted standard deviation (chi-square {value:.3g}, limit "
        f"{limit:.3g})",
        value, limit, "", len(error),
    )  # fmt: skip


def _turns(angle_deg: FloatArray, sd_deg: FloatArray, value: float) -> Check:
    limit, worst = largest(2 * len(angle_deg)), int(np.argmax(angle_deg / sd_deg))
    return Check(
        HELD_OUT_TURNS, value <= limit,
        f"closure of {counted(len(angle_deg), 'turn')}: {angle_deg[worst]:.3g} deg at the worst, "
        f"where {sd_deg[worst]:.3g} is the predicted standard deviation of a component (chi-square "
        f"{value:.3g}, limit {limit:.3g})",
        value, limit, "", 2 * len(angle_deg),
    )  # fmt: skip


def _demanded(error_g: FloatArray, angle_deg: FloatArray, limits: ImuLimits) -> Iterator[Check]:
    for key, found, unit in (
        ("held_out_g", error_g, "g"),
        ("closure_deg", angle_deg, "deg"),
    ):
        limit = getattr(limits, key)
        if limit is not None:
            most = float(found.max())
            words = f"up to {most:.3g} {unit} (limit {limit:g})"
            held = most <= limit
            yield Check(
                f"[limits] {key}", held, words, most, limit, unit, len(found), demanded=True
            )


def earth(result: DynamicResult) -> Iterator[Check]:
    """Horizontal rate of the Earth, where a pass has estimated it: at most 15.04 deg/h."""
    searched = [done.north for done in result.passes if done.north[:, 1].any()]
    if not searched:
        return
    rate, sd = searched[-1][:, 0] / DEG_PER_H, searched[-1][:, 1] / DEG_PER_H
    size = np.linalg.norm(rate, axis=1)
    direction = rate / np.maximum(size, 1e-12)[:, None]
    own = np.sqrt(((direction * sd) ** 2).sum(axis=1))
    # The length of two components, each with its error: chi-square of 2 at the worst.
    times = math.sqrt(chi2.isf(SHARE / len(size), 2))
    worst = int(np.argmax(size - times * own))
    limit = EARTH_RATE_DEG_PER_H + times * float(own[worst])
    yield Check(
        "horizontal rate of the Earth", bool(size[worst] <= limit),
        f"{size[worst]:.3g} deg/h, standard deviation {own[worst]:.2g} (the Earth turns at "
        f"{EARTH_RATE_DEG_PER_H} deg/h; limit {limit:.3g})",
        float(size[worst]), limit, "deg/h", len(size),
    )  # fmt: skip


def rests_alone(result: DynamicResult) -> Iterator[Check]:
    """Accelerometers by the rests alone against the joint solution, where they determine them.

    The rests are part of the joint solution, so that a difference over the larger deviation has at
    most the variance 1; the largest of nine keeps its limit by Boole's inequality.
    """
    found = result.static
    if not found.determined:
        return
    name, times = found.largest
    count = len(found.names)
    limit = math.sqrt((1 + MODEL_TOLERANCE) * chi2.isf(SHARE / count, 1))
    yield Check(
        "rests alone", abs(times) <= limit,
        f"{name} differs from the joint solution by {abs(times):.2g} standard deviations, more "
        f"than the others (limit {limit:.2g})",
        abs(times), limit, "sd", count,
    )  # fmt: skip


def effects_off(off: Sequence[Effect]) -> Iterator[Check]:
    """Effects that are switched off, that show, and that move a constant out of its interval."""
    share = SHARE / max(1, len(off))
    shown = [e for e in off if chi2.sf(e.alone, e.states) < share]
    worst = max(shown, key=lambda e: e.moves_sd, default=None)
    if not off:
        return
    if worst is None:
        words = f"none of {len(off)} would move a constant"
        yield Check(EFFECTS_OFF, True, words, 0.0, MOVES_SD, "sd", len(off))
        return
    yield Check(
        EFFECTS_OFF, worst.moves_sd <= MOVES_SD,
        f"{worst.name} shows, and would move {worst.moved} by {worst.moves_sd:.3g} of its standard "
        f"deviations (limit {MOVES_SD})",
        worst.moves_sd, MOVES_SD, "sd", len(off),
    )  # fmt: skip
