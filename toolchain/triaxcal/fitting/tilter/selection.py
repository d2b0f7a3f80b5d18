"""Choice of thermal function and estimator by held-out error.

Two kinds of readings are held out (`fitting.tilter.heldout`): each calibration temperature but the
lowest and highest, in turn, three components a dwell; and the check dwells. The score is the rms
of all these values, in g. Every candidate is scored on the same values.

An rms of n values has a relative standard error of 1 / sqrt(2 n). Candidates within one standard
error of the best do not differ significantly: the one of them with the fewest parameters is taken,
then the estimator in the order of `PREFERENCE`, then the better score.

A curve through all temperatures cannot be held out itself: the remaining temperatures determine one
with a parameter less. Where the held-out error of the best candidate is no more than noise and
placement explain, that does not matter. Where it is more (F test, chance below `CHANCE`), the
candidate is known to miss the unit, and a curve through all temperatures is taken instead if its
estimated error (`fitting.tilter.heldout`) is smaller.

The residual of the fit is shown and never decides: it always falls with the number of parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from triaxcal.fitting.core.calibration import Candidate, Selection
from triaxcal.fitting.core.outliers import CHANCE, fisher_tail
from triaxcal.fitting.tilter.curves import TilterData, fit_curves
from triaxcal.fitting.tilter.estimators import position_residuals_g
from triaxcal.fitting.tilter.heldout import (
    Fold,
    check_errors,
    folds_of,
    root_mean_square,
    scored_checks,
    share_of,
    vector_errors,
)
from triaxcal.model.terms import NO_TERMS, Terms
from triaxcal.model.thermal.shape import ThermalShape
from triaxcal.readings.measurements import Dwell
from triaxcal.unit.choices import ESTIMATOR_WORDS

_ROUNDING_G = 1e-12
"""Errors below are the rounding of floats."""
PREFERENCE = ("least-squares", "equation-10", "half-sum")
"""Estimators, in the order of preference when they do not differ significantly."""


def select(
    data: TilterData,
    estimators: Sequence[str],
    shapes: Sequence[ThermalShape],
    checks: Sequence[Dwell],
    *,
    asked_for: bool,
    terms: Terms = NO_TERMS,
) -> Selection:
    """Score every shape with every estimator and choose.

    Parameters
    ----------
    data : TilterData
        Operators in the order of `estimators`.
    checks : sequence of Dwell
        Check dwells.
    asked_for : bool
        Whether unit.toml names the thermal function, so that there is one shape.
    terms : Terms
        Quadratic terms that are known; products of the axes vanish in the six positions.
    """
    scored = scored_checks(data, checks)
    folds = folds_of(data)
    rows = [
        row
        for shape in shapes
        for row in _score_shape(data, estimators, shape, folds, scored, terms=terms)
    ]
    values = 18 * len(folds) + len(scored)
    best = _choose(rows, values)
    reason = _reason(rows, best, len(folds), len(scored), len(data.readings.temps_degc))
    through = _through_all(rows, best, folds, data)
    if through is not None:
        share = share_of(folds, through.shape)
        reason = (
            f"it passes all {len(data.readings.temps_degc)} temperatures; {best.shape.label} does "
            f"not, and has {reason}, more than noise and placement explain; with one temperature "
            f"held out in turn {_micro_g(through.folds_g)} by {folds[0].shape(through.shape).label}"
            f", of which about {share:.2g} is left with all temperatures"
        )
        best = through
    if asked_for:
        reason = f"{best.title}: thermal function from unit.toml; {reason}"
    else:
        reason = f"{best.title}: {reason}"
    shown = [r for r in rows if r.estimator == best.estimator or r.shape == best.shape]
    table = tuple(row.candidate(chosen=row is best) for row in shown)
    return Selection(best.estimator, best.shape, table, reason)


@dataclass(frozen=True)
class _Row:
    estimator: str
    shape: ThermalShape
    held_out_g: float | None
    fit_residual_g: float
    folds_g: float | None
    """Rms error at the temperatures held out alone."""

    @property
    def title(self) -> str:
        return f"{self.shape.label}, bias by {ESTIMATOR_WORDS[self.estimator]}"

    def candidate(self, *, chosen: bool) -> Candidate:
        shape = self.shape
        return Candidate(
            estimator=self.estimator,
            shape=shape,
            parameters=shape.parameters,
            held_out_g=self.held_out_g,
            fit_residual_g=self.fit_residual_g,
            chosen=chosen,
            label=shape.label,
            short_label=shape.short_label,
        )


def _choose(rows: list[_Row], values: int) -> _Row:
    scored = [(r.held_out_g, r) for r in rows if r.held_out_g is not None]
    if not scored:
        return min(rows, key=_exact_key)
    limit = min(s for s, _ in scored) * (1.0 + _resolution(values))
    within = [(s, r) for s, r in scored if s <= limit]
    return min(
        within, key=lambda sr: (sr[1].shape.parameters, PREFERENCE.index(sr[1].estimator), sr[0])
    )[1]


def _through_all(
    rows: list[_Row], best: _Row, folds: Sequence[Fold], data: TilterData
) -> _Row | None:
    """The curve through all temperatures that is to be preferred to `best`, which misses them.

    Noise and placement make errors of variance v in a reading, known from the six positions at
    each temperature. At a temperature held out the curves' own error adds 4/6 v |w|^2 on average,
    w being their weights of the other temperatures. Where the held-out error is significantly
    larger, `best` is known not to follow the unit. A curve through all temperatures is then taken
    if the error that is estimated for it (`heldout.share_of`) is smaller.
    """
    count = len(data.readings.temps_degc)
    if not folds or best.folds_g is None or best.shape.parameters >= count:
        return None
    weights = [_weights(fold, best.shape) for fold in folds]
    expected = _variance_g2(data) * (1.0 + 4.0 / 6.0 * sum(weights) / len(folds))
    ratio = best.folds_g**2 / (expected + _ROUNDING_G**2)
    # Twelve constants are in error at each temperature held out; six of 18 readings are spare.
    if ratio <= 1.0 or fisher_tail(12 * len(folds), 6 * count, ratio) > CHANCE:
        return None
    through = [
        (row.folds_g * share_of(folds, row.shape), row.folds_g, row)
        for row in rows
        if row.estimator == best.estimator and row.shape.parameters == count and row.folds_g
    ]
    if not through:
        return None
    estimated, _, row = min(through, key=lambda found: found[:2])
    return row if estimated <= best.folds_g else None


def _weights(fold: Fold, shape: ThermalShape) -> float:
    """|w|^2: what unit noise of the constants at the other temperatures makes at this one."""
    reduced = fold.shape(shape)
    others = np.linalg.pinv(reduced.basis(fold.remaining.readings.temps_degc))
    weights = reduced.basis(fold.left_out.temps_degc)[0] @ others
    return float(weights @ weights)


def _variance_g2(data: TilterData) -> float:
    """Variance of a reading, g^2: noise and placement, over the positions at one temperature."""
    residual = position_residuals_g(data.design, data.readings.voltage_v)
    return float(np.sum(residual**2)) / (6.0 * len(residual))


def _exact_key(row: _Row) -> tuple[int, bool, int]:
    """Order where nothing is held out: most parameters, hence exact, then the shape between points.

    Of two curves through all points with as many parameters the one that stays between them is
    taken.
    """
    shape = row.shape
    return -shape.parameters, not shape.within_points, PREFERENCE.index(row.estimator)


def _reason(rows: list[_Row], best: _Row, folds: int, checks: int, temperatures: int) -> str:
    """Why this row; the caller has named it. Every comparison holds for the numbers beside it."""
    values = 18 * folds + checks
    if best.held_out_g is None:
        return (
            f"nothing can be held out ({temperatures} temperature{'s' * (temperatures != 1)}, no "
            "check dwells among them), so this is the simplest that the data determine exactly"
        )
    held = [f"{folds} temperatures held out in turn"] if folds else []
    held += [f"{checks} check dwells"] if checks else []
    own = f"held-out error {_micro(best)} over {values} values ({', '.join(held)})"
    if len(rows) == 1:
        return f"{own}, the only candidate"
    top = min(rows, key=lambda r: np.inf if r.held_out_g is None else r.held_out_g)
    if top is best:
        return f"{own}, the smallest of {len(rows)} candidates"
    resolution = _resolution(values)
    assert best.held_out_g <= (top.held_out_g or 0.0) * (1.0 + resolution)
    return (
        f"{own}, the simplest of {len(rows)} candidates within one standard error "
        f"({100.0 * resolution:.1f} %) of the best, {_micro(top)} of {top.title}"
    )


def _resolution(values: int) -> float:
    """Relative standard error of an rms of so many values."""
    return float(1.0 / np.sqrt(2.0 * values))


def _micro(row: _Row) -> str:
    return _micro_g(row.held_out_g)


def _micro_g(error_g: float | None) -> str:
    return "none" if error_g is None else f"{error_g * 1e6:.4g} micro-g"


def _score_shape(
    data: TilterData,
    estimators: Sequence[str],
    shape: ThermalShape,
    folds: Sequence[Fold],
    checks: Sequence[Dwell],
    *,
    terms: Terms,
) -> list[_Row]:
    parameters = fit_curves(data, shape)
    fit_error = vector_errors(data.readings, shape, parameters, data.design)
    by_fold = [fold.force_errors(shape).reshape(len(estimators), -1) for fold in folds]
    at_checks = check_errors(shape, parameters, checks, data.gravity_g, terms)
    values = np.concatenate([*by_fold, at_checks], axis=1)
    rows = []
    for e, estimator in enumerate(estimators):
        score = root_mean_square(values[e]) if values.shape[1] else None
        of_folds = root_mean_square(np.array([f[e] for f in by_fold])) if folds else None
        residual = root_mean_square(fit_error[e])
        rows.append(_Row(estimator, shape, score, residual, of_folds))
    return rows
