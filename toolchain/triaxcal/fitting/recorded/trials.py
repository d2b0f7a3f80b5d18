"""Candidates of a recording: each fitted, each judged by poses that it has not seen.

Left out in turn is every orientation with all its poses (two poses alike would give each other
away), and every inner temperature where there are four and more. What is held out is scored by
|a| - g. Every candidate is scored on the same poses; one whose constants the remaining poses leave
open in any turn is not scored.

Where a linear candidate that all poses determine cannot be scored so (six faces: no orientation can
be spared), single poses are held out instead, a weaker test, for poses alike stay in. Where even
that is impossible nothing is held out, and the candidate with the most constants is taken: as with
the tilter, what the data determine exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from triaxcal.fitting.core.calibration import Candidate
from triaxcal.fitting.recorded.checks import CONDITION_MAX
from triaxcal.fitting.recorded.magnitude import ScalarFit, fit_scalar
from triaxcal.fitting.recorded.scalar import ScalarData, ScalarModel
from triaxcal.model.thermal.shape import ThermalShape
from triaxcal.model.types import BoolArray, FloatArray

Turn = tuple[BoolArray, BoolArray]
"""Poses that are held out, and those of them that are judged, as masks."""
TURNS_MAX = 60
"""Of hundreds of poses one more or less held out changes nothing that a rms could show."""


def detail(shape: ThermalShape, gain_functions: int) -> str:
    """How the constants follow temperature: U0 as `shape`, K with its first functions."""
    if gain_functions == shape.parameters:
        return shape.detail
    return f"{shape.detail}, K of {shape.nested(gain_functions).detail}"


@dataclass(frozen=True)
class Trial:
    """A candidate: which constants, and how they follow temperature.

    Attributes
    ----------
    gain_functions : int
        How many functions of `shape` the entries of K have; the biases have all.
    rate : bool
        Whether the biases also have a term in dT/dt.
    """

    model: ScalarModel
    shape: ThermalShape
    gain_functions: int
    rate: bool = False

    @property
    def parameters(self) -> int:
        """Free parameters over all temperatures."""
        m, q = len(self.model.gain), len(self.model.quadratic)
        return m * self.gain_functions + 3 * (self.shape.parameters + self.rate) + q

    def basis(self, temps_degc: FloatArray, rates: FloatArray | None) -> FloatArray:
        """Functions of temperature at the poses, (n, P), the rate over its largest the last."""
        functions = self.shape.basis(temps_degc)
        if not self.rate or rates is None:
            return functions
        return np.column_stack([functions, rates / np.abs(rates).max()])

    @property
    def label(self) -> str:
        """Words for tables."""
        if self.shape.parameters == 1 and not self.rate:
            return self.model.label
        of_rate = " and dT/dt" if self.rate else ""
        return f"{self.model.label}; {detail(self.shape, self.gain_functions)}{of_rate}"


@dataclass(frozen=True)
class PoseClimate:
    """Temperatures of the poses, (n,); dT/dt there in K/s, where it is known; the fit's loss."""

    temps_degc: FloatArray
    rates: FloatArray | None
    loss: str


@dataclass(frozen=True)
class Judged:
    """A trial's fit and scores.

    Attributes
    ----------
    held_out_g : float or None
        Rms |a| - g of what was held out; None when not scored.
    able : bool
        Whether all poses together determine it.
    errors_g : array or None
        |a| - g of everything held out, in the order of the turns.
    """

    trial: Trial
    fit: ScalarFit
    held_out_g: float | None
    able: bool
    errors_g: FloatArray | None = None

    def length_g(self, poses: int) -> float | None:
        """Rms |a| - g of the `poses` poses, each held out with its orientation: the first turns."""
        if self.errors_g is None:
            return None
        return float(np.sqrt(np.mean(self.errors_g[:poses] ** 2)))

    def candidate(self, estimator: str, *, chosen: bool) -> Candidate:
        """Row of the table."""
        return Candidate(
            estimator=estimator,
            shape=self.trial.shape,
            parameters=self.trial.parameters,
            held_out_g=self.held_out_g,
            fit_residual_g=self.fit.rms_g,
            chosen=chosen,
            label=self.trial.label,
            short_label=self.trial.label,
            condition=self.fit.condition,
        )


def folds(
    orientations: Sequence[Sequence[int]], temperatures: Sequence[Sequence[int]], count: int
) -> list[Turn]:
    """Masks of what is held out in turn: orientations, then inner temperatures (rising).

    More than `TURNS_MAX` orientations are held out in so many groups.
    """
    inner = temperatures[1:-1] if len(temperatures) >= 4 else ()
    turns = [[k for g in orientations[n::TURNS_MAX] for k in g] for n in range(TURNS_MAX)]
    masks: list[Turn] = []
    for group in (*(filter(None, turns) if len(orientations) > 1 else ()), *inner):
        mask = np.zeros(count, dtype=np.bool_)
        mask[list(group)] = True
        masks.append((mask, mask))
    return masks


def judge(trial: Trial, data: ScalarData, poses: PoseClimate, left_out: Sequence[Turn]) -> Judged:
    """Fit a trial to all poses, and to what each turn leaves."""
    own, loss = data.with_basis(trial.basis(poses.temps_degc, poses.rates)), poses.loss
    fit = fit_scalar(trial.model, own, trial.gain_functions, loss)
    if fit.condition > CONDITION_MAX or len(fit.residual_g) < trial.parameters:
        return Judged(trial, fit, None, able=False)
    errors = []
    for mask, judged in left_out:
        part = fit_scalar(
            trial.model, own.select(~mask), trial.gain_functions, loss, start=fit.theta
        )
        if part.condition > CONDITION_MAX or len(part.residual_g) < trial.parameters:
            return Judged(trial, fit, None, able=True)
        errors.append(part.errors_g(own.select(judged)))
    if not errors:
        return Judged(trial, fit, None, able=True)
    every = np.concatenate(errors)
    return Judged(trial, fit, float(np.sqrt(np.mean(every**2))), able=True, errors_g=every)


def unscored(rows: Sequence[Judged]) -> list[Judged]:
    """Linear candidates at one temperature that are determined, but could not be scored."""
    return [
        row
        for row in rows
        if row.able
        and row.held_out_g is None
        and not len(row.trial.model.quadratic)
        and row.trial.shape.parameters == 1
    ]


def choose(rows: Sequence[Judged]) -> Judged:
    """The simplest candidate that no other beats on what was held out (`beats`).

    Where linear candidates could not be scored, the one of them with the most constants.
    """
    if unscored(rows):
        return max(unscored(rows), key=lambda row: row.trial.parameters)
    scored = [row for row in rows if row.able and row.errors_g is not None]
    if not scored:
        return max((row for row in rows if row.able), key=lambda row: row.trial.parameters)
    unbeaten = [
        row for row in scored if not any(beats(other.errors_g, row.errors_g) for other in scored)
    ]
    return min(unbeaten, key=lambda row: (row.trial.parameters, row.held_out_g))


def without_idle_rates(rows: Sequence[Judged], values: int) -> list[Judged]:
    """Rows without the terms in dT/dt that do not win on half-cycles held out, the last `values`.

    A term in dT/dt must beat the same candidate without it there, whatever it gains elsewhere.
    """
    plain = {(r.trial.shape, r.trial.gain_functions): r for r in rows if not r.trial.rate}
    kept = []
    for row in rows:
        rival = plain.get((row.trial.shape, row.trial.gain_functions))
        if row.trial.rate and (
            row.errors_g is None
            or rival is None
            or rival.errors_g is None
            or not beats(row.errors_g[-values:], rival.errors_g[-values:])
        ):
            continue
        kept.append(row)
    return kept


def beats(errors: FloatArray | None, rival: FloatArray | None) -> bool:
    """Whether held-out errors are significantly smaller than a rival's on the same values.

    An rms of n values is known to 1 / sqrt(2 n) of itself (tilter.selection), so it must be smaller
    by that much; and the squares, value by value, must differ by two standard errors of their mean,
    or the rms must be below half, an F of 4, where few values make a standard error of no use.
    """
    if errors is None or rival is None:
        return False
    own, other = (float(np.sqrt(np.mean(e**2))) for e in (errors, rival))
    if own * (1.0 + 1.0 / np.sqrt(2.0 * errors.size)) >= other:
        return False
    difference = (rival**2 - errors**2).ravel()
    sd = float(difference.std(ddof=1)) / np.sqrt(difference.size) if difference.size > 1 else 0.0
    return own < 0.5 * other or float(difference.mean()) > 2.0 * sd


def reason(rows: Sequence[Judged], best: Judged, turns: str, values: int) -> str:
    """Why this candidate, in words."""
    label = best.trial.label
    if best.held_out_g is None:
        return (
            f"{label}: the fit needs every pose, so none is held out and no candidate is compared; "
            "record more poses, in other orientations"
        )
    scored = [row for row in rows if row.held_out_g is not None]
    text = (
        f"{label}: held-out error {_mg(best)} over {values} values ({turns} held out in turn), "
        f"the simplest of {len(scored)} candidates; no other is significantly better"
    )
    top = min(scored, key=lambda row: row.held_out_g or 0.0)
    return text if top is best else f"{text}; {_mg(top)} of {top.trial.label}"


def _mg(row: Judged) -> str:
    return f"{(row.held_out_g or 0.0) * 1e3:.3g} mg"
