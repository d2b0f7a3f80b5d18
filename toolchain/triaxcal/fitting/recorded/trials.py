"""Candidates of a recording: each fitted, each judged by poses that it has not seen.

The calibration is the fit with priors (`recorded.prior`). The candidates without them are a
diagnosis: they show what the poses alone would say, and choose nothing.

Held out in turn is every orientation with all its poses (two poses alike would give each other
away), every inner temperature where there are four and more, and every half-cycle. What is held out
is scored by |a| - g. A pose counts where the others determine it: where the linear fit of the rest
expects an error below half the limit. Six faces determine none of each other; single poses are then
held out, a weaker test, for poses alike stay in. Where even that leaves none, nothing is tested.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from triaxcal.fitting.core.calibration import Candidate
from triaxcal.fitting.recorded.checks import CONDITION_MAX
from triaxcal.fitting.recorded.magnitude import fit_scalar, fit_with_prior
from triaxcal.fitting.recorded.prior import Known
from triaxcal.fitting.recorded.scalar import ScalarData, ScalarModel
from triaxcal.fitting.recorded.scales import ScaleEvidence
from triaxcal.fitting.recorded.solution import Held, ScalarFit
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
    known : Known or None
        What is known beforehand; None for the poses alone.
    """

    model: ScalarModel
    shape: ThermalShape
    gain_functions: int
    rate: bool = False
    known: Known | None = None

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

    def basis_at(self, temp_degc: float) -> FloatArray:
        """The same at one temperature that stands still, (P,)."""
        return np.append(self.shape.basis(temp_degc), np.zeros(int(self.rate)))

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
    expected_g : float or None
        Rms of them that the fits with priors expect, with the noise of each pose.
    """

    trial: Trial
    fit: ScalarFit
    held_out_g: float | None
    able: bool
    errors_g: FloatArray | None = None
    expected_g: float | None = None

    def log_evidence(self, weighed: Judged) -> float:
        """Ln of the probability of the poses with the weights that another fit gave them."""
        known = self.trial.known
        assert known is not None
        evidence = ScaleEvidence(known, self.fit, weighed.fit.posterior)
        return evidence.log_evidence(known.priors)

    def length_g(self, values: int) -> float | None:
        """Rms |a| - g of the first `values` held-out values, those of orientations; None for 0."""
        if self.errors_g is None or not values:
            return None
        return float(np.sqrt(np.mean(self.errors_g[:values] ** 2)))

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


def orientation_turns(orientations: Sequence[Sequence[int]], count: int) -> list[Turn]:
    """Masks of what is held out in turn: orientations, more than `TURNS_MAX` in so many groups."""
    if len(orientations) < 2:
        return []
    turns = [[k for g in orientations[n::TURNS_MAX] for k in g] for n in range(TURNS_MAX)]
    return [_turn(group, count) for group in turns if group]


def temperature_turns(temperatures: Sequence[Sequence[int]], count: int) -> list[Turn]:
    """The same of inner temperatures (rising), where there are four and more."""
    inner = temperatures[1:-1] if len(temperatures) >= 4 else ()
    return [_turn(group, count) for group in inner]


def _turn(group: Sequence[int], count: int) -> Turn:
    mask = np.zeros(count, dtype=np.bool_)
    mask[list(group)] = True
    return mask, mask


def judge(trial: Trial, data: ScalarData, poses: PoseClimate, left_out: Sequence[Turn]) -> Judged:
    """Fit a trial to all poses, and to what each turn leaves."""
    own = data.with_basis(trial.basis(poses.temps_degc, poses.rates))
    fit = _fit(trial, own, poses.loss)
    if not _determined(trial, fit):
        return Judged(trial, fit, None, able=False)
    errors, expected = [], []
    for mask, judged in left_out:
        part = _held(trial, own, poses.loss, fit, mask)
        if trial.known is None and (
            part.condition > CONDITION_MAX or (~mask).sum() < trial.parameters
        ):
            return Judged(trial, fit, None, able=True)
        out = own.select(judged)
        errors.append(part.errors_g(out))
        if fit.posterior is not None:
            expected.append(part.expected_g(out) ** 2 + (fit.posterior.scale / out.quality) ** 2)
    if not errors:
        return Judged(trial, fit, None, able=True)
    every = np.concatenate(errors)
    rms, among = float(np.sqrt(np.mean(every**2))), None
    if fit.posterior is not None:
        among = float(np.sqrt(np.mean(np.concatenate(expected))))
    return Judged(trial, fit, rms, able=True, errors_g=every, expected_g=among)


def _fit(trial: Trial, data: ScalarData, loss: str, near: ScalarFit | None = None) -> ScalarFit:
    if trial.known is not None:
        return fit_with_prior(
            trial.model, data, trial.gain_functions, trial.known, loss=loss, near=near
        )
    start = None if near is None else near.theta
    return fit_scalar(trial.model, data, trial.gain_functions, loss, start=start)


def _held(trial: Trial, data: ScalarData, loss: str, fit: ScalarFit, mask: BoolArray) -> Held:
    """The fit without the poses of a mask: by one step, or by all of them."""
    near = fit.without(mask)
    return near if near is not None else _fit(trial, data.select(~mask), loss, fit).held()


def _determined(trial: Trial, fit: ScalarFit) -> bool:
    """Whether the poses alone determine the constants; with priors all are known."""
    if trial.known is not None:
        return True
    return fit.condition <= CONDITION_MAX and len(fit.residual_g) >= trial.parameters


def expected_errors(
    trial: Trial, data: ScalarData, poses: PoseClimate, left_out: Sequence[Turn]
) -> list[FloatArray]:
    """Standard deviations of |a| that the rest expects of what each turn judges, without noise."""
    own = data.with_basis(trial.basis(poses.temps_degc, poses.rates))
    fit = _fit(trial, own, poses.loss)
    return [
        _held(trial, own, poses.loss, fit, mask).expected_g(own.select(judged))
        for mask, judged in left_out
    ]


def worth_judging(
    left_out: Sequence[Turn], expected: Sequence[FloatArray], limit_g: FloatArray
) -> list[Turn]:
    """Turns with those poses alone whose expected error is below half their limit (n,)."""
    kept = []
    for (mask, judged), sd in zip(left_out, expected, strict=True):
        good = judged.copy()
        good[judged] = sd <= 0.5 * limit_g[judged]
        if good.any():
            kept.append((mask, good))
    return kept


def choose(rows: Sequence[Judged]) -> Judged:
    """The simplest candidate that no other beats on what was held out (`beats`).

    Where nothing was held out, the one that the poses make most probable: fits with priors, and
    the poses with the weights of the one with the most constants.
    """
    scored = [row for row in rows if row.errors_g is not None]
    if not scored:
        full = max(rows, key=lambda row: row.trial.parameters)
        return max(rows, key=lambda row: row.log_evidence(full))
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
