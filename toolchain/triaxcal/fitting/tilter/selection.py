"""Choice of thermal function and estimator by held-out error.

Two kinds of readings are held out. (a) Each calibration temperature but the lowest and highest, in
turn: the force in its six positions, computed with curves fitted without it, is compared with the
known force, three components a dwell. (b) The check dwells: |a| - g. The score is the rms of all
these values, in g. Every candidate is scored on the same values: for (a), one that needs all
temperatures is fitted with an order or a knot less. (a) needs four temperatures, because three
must remain to show a curvature.

An rms of n values has a relative standard error of 1 / sqrt(2 n). Candidates within one standard
error of the best do not differ significantly: the one of them with the fewest parameters is taken,
then the estimator in the order of `PREFERENCE`, then the better score. The residual of the fit is
shown and never decides: it always falls with the number of parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from triaxcal.fitting.core.calibration import Candidate, Selection
from triaxcal.fitting.core.grouping import GroupedReadings
from triaxcal.fitting.tilter.curves import TilterData, fit_curves
from triaxcal.model.metrological import force_from_voltage
from triaxcal.model.terms import NO_TERMS, Terms
from triaxcal.model.thermal.shape import EDGE_DEGC, ThermalShape
from triaxcal.model.types import FloatArray
from triaxcal.readings.measurements import Dwell

PREFERENCE = ("least-squares", "equation-10", "half-sum")
"""Estimators, in the order of preference when they do not differ significantly."""


def select(
    data: TilterData,
    estimators: Sequence[str],
    shapes: Sequence[ThermalShape],
    checks: Sequence[Dwell],
    *,
    asked_for: bool,
    limit_g: float,
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
    limit_g : float
        A candidate that misses its own fitted readings by more (rms) would be refused afterwards,
        P1 (13), and is not chosen while another is left.
    terms : Terms
        Quadratic terms that are known; products of the axes vanish in the six positions.
    """
    low, high = data.readings.temps_degc[0], data.readings.temps_degc[-1]
    scored = [d for d in checks if low - EDGE_DEGC <= d.temp_degc <= high + EDGE_DEGC]
    folds = _folds(data)
    rows = [
        row
        for shape in shapes
        for row in _score_shape(data, estimators, shape, folds, scored, terms=terms)
    ]
    values = 18 * len(folds) + len(scored)
    able = [r for r in rows if r.fit_residual_g <= limit_g] or rows
    best = _choose(able, values)
    reason = _reason(rows, best, len(folds), len(scored), len(data.readings.temps_degc))
    if asked_for:
        reason = f"{best.title}: thermal function from unit.toml; {reason}"
    else:
        reason = f"{best.title}: {reason}"
    shown = [r for r in rows if r.estimator == best.estimator or r.shape == best.shape]
    table = tuple(row.candidate(chosen=row is best) for row in shown)
    return Selection(best.estimator, best.shape, table, reason)


@dataclass(frozen=True)
class _Fold:
    """The readings without one temperature, and those of that temperature."""

    remaining: TilterData
    left_out: GroupedReadings


@dataclass(frozen=True)
class _Row:
    estimator: str
    shape: ThermalShape
    held_out_g: float | None
    fit_residual_g: float

    @property
    def title(self) -> str:
        return f"{self.shape.label} with {self.estimator}"

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
    limit = min(s for s, _ in scored) * (1.0 + 1.0 / np.sqrt(2.0 * values))
    within = [(s, r) for s, r in scored if s <= limit]
    return min(
        within, key=lambda sr: (sr[1].shape.parameters, PREFERENCE.index(sr[1].estimator), sr[0])
    )[1]


def _exact_key(row: _Row) -> tuple[int, bool, int]:
    """Order where nothing is held out: most parameters, hence exact, then the shape between points.

    Of two curves through all points with as many parameters the one that stays between them is
    taken.
    """
    shape = row.shape
    return -shape.parameters, not shape.within_points, PREFERENCE.index(row.estimator)


def _reason(rows: list[_Row], best: _Row, folds: int, checks: int, temperatures: int) -> str:
    """Why this row; the caller has named it."""
    values = 18 * folds + checks
    if not values:
        return (
            f"nothing can be held out ({temperatures} temperature{'s' * (temperatures != 1)}, no "
            "check dwells among them), so this is the simplest that the data determine exactly"
        )
    held = [f"{folds} temperatures held out in turn"] if folds else []
    held += [f"{checks} check dwells"] if checks else []
    own = f"held-out error {_micro(best)} over {values} values ({', '.join(held)})"
    if len(rows) == 1:
        return f"{own}, the only candidate"
    resolution = 100.0 / np.sqrt(2.0 * values)
    text = (
        f"{own}, the simplest of {len(rows)} candidates within one standard error "
        f"({resolution:.1f} %) of the best"
    )
    top = min(rows, key=lambda r: r.held_out_g or 0.0)
    return text if top is best else f"{text}, {_micro(top)} of {top.title}"


def _micro(row: _Row) -> str:
    return "none" if row.held_out_g is None else f"{row.held_out_g * 1e6:.4g} micro-g"


def _score_shape(
    data: TilterData,
    estimators: Sequence[str],
    shape: ThermalShape,
    folds: Sequence[_Fold],
    checks: Sequence[Dwell],
    *,
    terms: Terms,
) -> list[_Row]:
    parameters = fit_curves(data, shape)
    fit_error = _vector_errors(data.readings, shape, parameters, data.design)
    held_out = [_fold_errors(fold, shape, data.design) for fold in folds]
    held_out += [check_errors(shape, parameters, checks, data.gravity_g, terms)]
    values = np.concatenate([part.reshape(len(estimators), -1) for part in held_out], axis=1)
    rows = []
    for e, estimator in enumerate(estimators):
        score = _rms(values[e]) if values.shape[1] else None
        rows.append(_Row(estimator, shape, score, _rms(fit_error[e])))
    return rows


def _folds(data: TilterData) -> list[_Fold]:
    """Each inner temperature held out in turn; none with fewer than four temperatures."""
    count = len(data.readings.temps_degc)
    return [
        _Fold(
            remaining=data.select([g for g in range(count) if g != left_out]),
            left_out=data.readings.select([left_out]),
        )
        for left_out in (range(1, count - 1) if count >= 4 else ())
    ]


def _fold_errors(fold: _Fold, shape: ThermalShape, design: FloatArray) -> FloatArray:
    """Errors (E, 1, 6, 3) in g at the temperature held out, of curves fitted without it."""
    temps = fold.remaining.readings.temps_degc
    reduced = shape.without(temps, float(fold.left_out.temps_degc[0]))
    parameters = fit_curves(fold.remaining, reduced)
    return _vector_errors(fold.left_out, reduced, parameters, design)


def _vector_errors(
    readings: GroupedReadings, shape: ThermalShape, parameters: FloatArray, design: FloatArray
) -> FloatArray:
    """Computed minus known force, shape (E, G, 6, 3), g; each dwell at its own temperature."""
    basis = shape.basis(readings.dwell_temps_degc)
    constants = basis @ np.swapaxes(parameters, -1, -2)[:, None]
    return force_from_voltage(constants, readings.voltage_v) - design[:, :3]


def check_errors(
    shape: ThermalShape,
    parameters: FloatArray,
    checks: Sequence[Dwell],
    gravity_g: float,
    terms: Terms,
) -> FloatArray:
    """|a| - g of P1 (13) at check dwells, shape (E, dwells), g; parameters (E, 12, P)."""
    temps = np.array([d.temp_degc for d in checks], dtype=np.float64)
    voltage = np.array([d.voltage_v for d in checks], dtype=np.float64).reshape(-1, 3)
    constants = shape.basis(temps) @ np.swapaxes(parameters, -1, -2)
    force = terms.force_g(force_from_voltage(constants, voltage))
    error: FloatArray = np.linalg.norm(force, axis=-1) - gravity_g
    return error


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
