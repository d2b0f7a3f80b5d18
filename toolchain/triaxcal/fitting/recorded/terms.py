"""Which terms beyond the linear constants go into the C: those that unseen poses ask for.

The fit with priors knows all terms; the firmware need not compute them. Terms are put into the C
where both are true:

1. their largest effect on a component at 1 g, after the linear constants have been fitted anew
   without them, is above the standard uncertainty of that component;
2. without them the held-out error is larger by more than two of its standard errors: an rms of n
   values is known to 1 / sqrt(2 n) of itself.

`[firmware] terms` decides instead where it is stated. What is left out stays in the uncertainty:
the covariance about the delivered constants is that of the full fit, and the square of the shift
from its solution.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.recorded.prior import FULL, LINEAR, OWN_SQUARES, WIDE
from triaxcal.fitting.recorded.scalar import ScalarModel
from triaxcal.fitting.recorded.solution import ScalarFit
from triaxcal.fitting.recorded.trials import Judged
from triaxcal.model.terms import products
from triaxcal.model.types import FloatArray
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.priors import AUTO
from triaxcal.unit.priors import LINEAR as LINEAR_C
from triaxcal.unit.priors import OWN_SQUARES as OWN_SQUARES_C
from triaxcal.unit.priors import QUADRATIC_TERMS as QUADRATIC_C

_DIRECTIONS = 200


@dataclass(frozen=True)
class Delivered:
    """What goes into the C, and the fit that knows all terms.

    Attributes
    ----------
    own : Judged
    full : Judged
        The same row where nothing is left out.
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
        return LINEAR, OWN_SQUARES, FULL, WIDE
    if unit.firmware_terms in {OWN_SQUARES_C, QUADRATIC_C}:
        raise RefusedError(
            f"{unit.source}, [firmware] terms",
            f'"{unit.firmware_terms}" with [fit] terms = "linear"',
            expected="terms that are fitted",
            remedy='remove one of them, or state [firmware] terms = "linear"',
        )
    return (LINEAR,)


def choose_terms(unit: UnitDescription, rows: Sequence[Judged]) -> Delivered:
    """What goes into the C, of rows of `models_of` with one thermal function."""
    by_model = {row.trial.model.label: row for row in rows}
    linear = by_model[LINEAR.label]
    if len(rows) == 1:
        return Delivered(linear, linear, "no terms are fitted: [fit] terms")
    full, wide = by_model[FULL.label], by_model[WIDE.label]
    best = min((full, wide), key=_score)
    if _better(wide, full):
        full = best = wide
    stated = unit.firmware_terms
    if stated == AUTO and unit.terms == "quadratic":
        stated = QUADRATIC_C
    if stated != AUTO:
        return _stated(stated, by_model, linear, full)
    own = min((by_model[OWN_SQUARES.label], best), key=_score)
    effect, u = largest_effect(unit, linear, own)
    words = f"largest effect {_mg(effect)} at 1 g, where the standard uncertainty is {_mg(u)}"
    if own.held_out_g is None or linear.held_out_g is None:
        return Delivered(linear, full, f"left out of the C: {words}; nothing is held out")
    count = 0 if own.errors_g is None else own.errors_g.size
    scores = (
        f"held-out error {_mg(own.held_out_g)} with them, {_mg(linear.held_out_g)} without "
        f"(two standard errors: {2.0 / math.sqrt(2.0 * count):.0%})"
    )
    larger = own.held_out_g * (1.0 + 2.0 / math.sqrt(2.0 * count)) < linear.held_out_g
    if effect > u and larger:
        name = "own squares" if own is by_model[OWN_SQUARES.label] else "quadratic terms"
        kept = own if own is by_model[OWN_SQUARES.label] else best
        at = full if kept is not wide else wide
        return Delivered(kept, at, f"{name} are in the C: {words}; {scores}")
    return Delivered(linear, full, f"left out of the C: {words}; {scores}")


def _stated(stated: str, by_model: Mapping[str, Judged], linear: Judged, full: Judged) -> Delivered:
    own = {LINEAR_C: linear, OWN_SQUARES_C: by_model[OWN_SQUARES.label], QUADRATIC_C: full}[stated]
    key = "[firmware] terms" if stated != QUADRATIC_C else "[firmware] or [fit] terms"
    return Delivered(own, full, f'{key} = "{stated}"')


def _score(row: Judged) -> float:
    return math.inf if row.held_out_g is None else row.held_out_g


def _better(row: Judged, rival: Judged) -> bool:
    """Whether held-out errors are smaller by a standard error."""
    if row.held_out_g is None or rival.held_out_g is None or row.errors_g is None:
        return False
    return row.held_out_g * (1.0 + 1.0 / math.sqrt(2.0 * row.errors_g.size)) < rival.held_out_g


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
