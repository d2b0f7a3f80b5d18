"""Which terms beyond the linear constants go into the C: those that the poses ask for.

The fit with priors knows all terms; the firmware need not compute them. What is delivered is
fitted with the scales of the priors that the poses of this unit show (`recorded.scales`). Terms are
put into the C where both are true:

1. the poses are `ODDS` times as probable with them as without them, with the constants, their
   scales and the noise integrated out. That probability is the product of those of each pose
   predicted from the poses before it: terms that only follow the noise lower it;
2. their largest effect on a component at 1 g, after the linear constants have been fitted anew
   without them, is above the standard uncertainty of that component.

`[firmware] terms` decides instead where it is stated. What is left out stays in the uncertainty:
the covariance about the delivered constants is that of the fit with all terms and the stated
priors, and the shift from its solution is a source of its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.recorded.prior import FULL, LINEAR, OWN_SQUARES
from triaxcal.fitting.recorded.scalar import ScalarData, ScalarModel
from triaxcal.fitting.recorded.scales import MOST_OF_A_UNIT, ScaleEvidence, scales_of
from triaxcal.fitting.recorded.solution import ScalarFit
from triaxcal.fitting.recorded.trials import Judged, PoseClimate, Trial, Turn, judge
from triaxcal.model.terms import products
from triaxcal.model.types import FloatArray
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.priors import AUTO
from triaxcal.unit.priors import LINEAR as LINEAR_C
from triaxcal.unit.priors import OWN_SQUARES as OWN_SQUARES_C
from triaxcal.unit.priors import QUADRATIC_TERMS as QUADRATIC_C

ODDS = 10.0
"""What terms in the C need; the usual word for such odds is strong."""
_ALIKE = 1.05
"""Odds that are no difference."""
_DIRECTIONS = 200
_SCALED = " scaled by the poses"


@dataclass(frozen=True)
class Scaled:
    """A model with the scales of its priors that the poses show.

    Attributes
    ----------
    row : Judged
    log_evidence : float
        Ln of the probability of the poses, with the scales integrated out.
    """

    row: Judged
    log_evidence: float


@dataclass(frozen=True)
class Delivered:
    """What goes into the C, and the fit that knows all terms.

    Attributes
    ----------
    own : Judged
    full : Judged
        Of all terms that are fitted, with the priors as stated.
    reason : str
        The rule and its numbers.
    """

    own: Judged
    full: Judged
    reason: str


def models_of(unit: UnitDescription) -> tuple[ScalarModel, ...]:
    """Models with priors that are fitted, the linear one first.

    Raises
    ------
    RefusedError
        When [firmware] asks for terms that [fit] rules out.
    """
    if unit.terms != "linear":
        return LINEAR, OWN_SQUARES, FULL
    if unit.firmware_terms in {OWN_SQUARES_C, QUADRATIC_C}:
        raise RefusedError(
            f"{unit.source}, [firmware] terms",
            f'"{unit.firmware_terms}" with [fit] terms = "linear"',
            expected="terms that are fitted",
            remedy='remove one of them, or state [firmware] terms = "linear"',
        )
    return (LINEAR,)


def scaled_by_poses(
    trial: Trial,
    data: ScalarData,
    poses: PoseClimate,
    left_out: Sequence[Turn],
    full: ScalarFit,
) -> Scaled:
    """A trial with the scales of its priors that the poses show, those held out among them.

    The poses have the weights of the fit with all terms, `full`.
    """
    known = trial.known
    assert known is not None
    fit = judge(trial, data, poses, []).fit
    evidence = ScaleEvidence(known, fit, full.posterior)
    scales = scales_of([evidence], known.priors, MOST_OF_A_UNIT)
    model = replace(trial.model, label=f"{trial.model.label}{_SCALED}")
    own = replace(trial, model=model, known=replace(known, priors=scales.priors))
    return Scaled(judge(own, data, poses, left_out), scales.log_evidence)


def choose_terms(unit: UnitDescription, full: Judged, scaled: Sequence[Scaled]) -> Delivered:
    """What goes into the C, of the models of `models_of` with one thermal function.

    `full` is the last of them with the priors as stated.
    """
    linear = scaled[0]
    if len(scaled) == 1:
        return Delivered(linear.row, full, "no terms are fitted: [fit] terms")
    stated = unit.firmware_terms
    if stated == AUTO and unit.terms == "quadratic":
        stated = QUADRATIC_C
    if stated != AUTO:
        own = scaled[(LINEAR_C, OWN_SQUARES_C, QUADRATIC_C).index(stated)]
        key = "[firmware] terms" if stated != QUADRATIC_C else "[firmware] or [fit] terms"
        return Delivered(own.row, full, f'{key} = "{stated}"')
    best = max(scaled[1:], key=lambda s: s.log_evidence)
    effect, u = largest_effect(unit, linear.row, best.row)
    log_odds = best.log_evidence - linear.log_evidence
    words = (
        f"the poses are {_odds(log_odds)} (needed: {ODDS:g} times as probable with them); largest "
        f"effect {_mg(effect)} at 1 g, where the standard uncertainty is {_mg(u)}"
    )
    if best.row.held_out_g is not None and linear.row.held_out_g is not None:
        words += (
            f"; held-out error {_mg(best.row.held_out_g)} with them, "
            f"{_mg(linear.row.held_out_g)} without"
        )
    if log_odds > math.log(ODDS) and effect > u:
        name = "own squares" if best is scaled[1] else "quadratic terms"
        return Delivered(best.row, full, f"{name} are in the C: {words}")
    return Delivered(linear.row, full, f"left out of the C: {words}")


def _odds(log_odds: float) -> str:
    """How much more probable the poses are, in words."""
    odds = math.exp(min(abs(log_odds), math.log(1e6)))
    if odds < _ALIKE:
        return "as probable with them as without them"
    than = "more than " * (odds > 999999.0)
    return f"{than}{odds:.3g} times as probable {'with' if log_odds > 0.0 else 'without'} them"


def largest_effect(unit: UnitDescription, linear: Judged, other: Judged) -> tuple[float, float]:
    """Largest difference of a component at T0 and 1 g, and its standard uncertainty there, g.

    Largest is meant in units of the uncertainty.
    """
    full = other.fit
    assert full.posterior is not None
    directions = spread_directions() * unit.gravity_g
    t0 = other.trial.basis_at(unit.t0_degc)
    K, bias, Q = _at(full, t0)
    K_linear, bias_linear, Q_linear = _at(linear.fit, t0)
    before = directions - products(directions) @ Q.T
    reading = before @ K.T + bias
    found: FloatArray = (reading - bias_linear) @ np.linalg.inv(K_linear).T
    found = found + products(found) @ Q_linear.T
    effect = np.abs(found - directions)
    rows = force_rows(full, t0, directions)
    variance = np.einsum("nip,pq,niq->ni", rows, full.posterior.spread_covariance, rows)
    sd = np.sqrt(np.maximum(variance, 1e-30))
    worst = np.unravel_index(int((effect / sd).argmax()), effect.shape)
    return float(effect[worst]), float(sd[worst])


def _at(fit: ScalarFit, basis: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    K, bias, Q = fit.split(fit.theta)
    return np.tensordot(basis, K, axes=1), basis @ bias, Q


def force_rows(fit: ScalarFit, basis: FloatArray, force: FloatArray) -> FloatArray:
    """Derivative (n, 3, parameters) of forces (n, 3) by theta, at readings that stay."""
    K = np.tensordot(basis, fit.split(fit.theta)[0], axes=1)
    N = np.linalg.inv(K)
    n, g = len(force), fit.gain_functions
    by_gain = -np.einsum("ij,mjk,nk->nim", N, fit.model.gain, force)
    gains = (by_gain[..., None] * basis[:g]).reshape(n, 3, -1)
    biases = np.broadcast_to((-N[:, :, None] * basis).reshape(3, -1), (n, 3, 3 * len(basis)))
    squares = np.einsum("qik,nk->niq", fit.model.quadratic, products(force))
    return np.concatenate([gains, biases, squares], axis=2)


def spread_directions(count: int = _DIRECTIONS) -> FloatArray:
    """Unit vectors all round, (count, 3): a Fibonacci spiral."""
    k = np.arange(count) + 0.5
    z = 1.0 - 2.0 * k / count
    angle = np.pi * (1.0 + np.sqrt(5.0)) * k
    ring = np.sqrt(1.0 - z**2)
    return np.column_stack([ring * np.cos(angle), ring * np.sin(angle), z])


def _mg(value_g: float) -> str:
    return f"{value_g * 1e3:.3g} mg"
