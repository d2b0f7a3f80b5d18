"""Candidates of poses with known angles, P0: each fitted, each judged by poses held out.

At one temperature they are the forms of `oriented`; over temperature the forward form (28) with
polynomials, which is linear in all unknowns: U = sum_p f_p(T) (d0_p + D_p g). Beside each of these
stand all terms with their priors (`full`). Held out in turn is every pose, and every inner
temperature where there are four and more: what they show decides, not a condition number.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from triaxcal.fitting.core.calibration import Candidate
from triaxcal.fitting.recorded.checks import CONDITION_MAX
from triaxcal.fitting.table.allterms import AllTerms
from triaxcal.fitting.table.full import FullFit, fit_full
from triaxcal.fitting.table.oriented import (
    TRACELESS,
    OrientedFit,
    scaled_condition,
)
from triaxcal.model.metrological import force_from_voltage, pack_constants
from triaxcal.model.terms import products
from triaxcal.model.thermal.shape import ThermalShape
from triaxcal.model.types import BoolArray, FloatArray
from triaxcal.unit.priors import Priors

LEFT_OUT_MAX = 10.0 * CONDITION_MAX
"""Of what a turn leaves: it is only to judge, not to ship."""
OPEN = 1e6
"""Condition number of quadratic terms that the poses leave open; below, held-out poses judge."""


@dataclass(frozen=True)
class TablePoses:
    """Poses whose specific force is known.

    Attributes
    ----------
    readings, force : arrays, shape (n, 3)
        Reading units, and g with the sign of the readings.
    temps_degc : array, shape (n,)
    known : array, shape (3, 6)
        Part of Q that is known beforehand.
    """

    readings: FloatArray
    force: FloatArray
    temps_degc: FloatArray
    known: FloatArray

    @property
    def target(self) -> FloatArray:
        """What is left to fit when the known part of Q is taken off, to first order in it."""
        result: FloatArray = self.force - products(self.force) @ self.known.T
        return result

    def select(self, kept: BoolArray) -> TablePoses:
        """Only the poses of a mask."""
        return TablePoses(self.readings[kept], self.force[kept], self.temps_degc[kept], self.known)


@dataclass(frozen=True)
class TableFit:
    """Constants from known orientations.

    Attributes
    ----------
    constants : array, shape (12, P)
        By function of `shape`, in the order of `CONSTANT_NAMES`.
    quadratic : array, shape (3, 6), or None
        Q of a = l + Q p(l).
    condition : float
    full : FullFit or None
        With priors: all that it gives.
    """

    shape: ThermalShape
    constants: FloatArray
    quadratic: FloatArray | None
    condition: float
    full: FullFit | None = None

    def force_g(self, poses: TablePoses) -> FloatArray:
        """Specific force, shape (n, 3), of the poses' readings."""
        constants = self.shape.basis(poses.temps_degc) @ self.constants.T
        linear = force_from_voltage(constants, poses.readings)
        if self.quadratic is None:
            return linear
        result: FloatArray = linear + products(linear) @ self.quadratic.T
        return result


@dataclass(frozen=True)
class TableTrial:
    """A candidate: label, way and solver; `gains` functions of temperature for K, all for U0.

    With `priors` all terms are fitted, whatever the solver.
    """

    label: str
    way: str
    shape: ThermalShape
    solver: Callable[[FloatArray, FloatArray], OrientedFit] | None
    unknowns: int
    gains: int = 1
    quadratic: bool = False
    priors: Priors | None = None

    @property
    def parameters(self) -> int:
        """Free parameters over all temperatures, those that only a prior determines left out."""
        if self.solver is not None:
            return self.unknowns
        of_q = 3 * len(TRACELESS) if self.priors is not None else 0
        return 9 * self.gains + 3 * self.shape.parameters + of_q

    def fit(self, poses: TablePoses, left_out: Sequence[BoolArray] = ()) -> TableFit:
        """Fit to the poses; with priors also what each of `left_out` is to the others."""
        if self.priors is not None:
            return _all_terms(self, self.priors, poses, left_out)
        if self.solver is None:
            return _forward_over_temperature(self.shape, self.gains, poses)
        found = self.solver(poses.readings, poses.target)
        constants = pack_constants(found.K, found.U0)[:, None]
        return TableFit(
            self.shape, constants, _with_known(found.quadratic, poses.known), found.condition
        )


@dataclass(frozen=True)
class TableRow:
    """A trial's fit and scores.

    Attributes
    ----------
    own_g : array, shape (n, 3)
        Error of each component in the fit of all poses.
    held_out_g : float or None
        Rms of `errors_g`, a component; None when not scored.
    errors_g : array, shape (m, 3), or None
        Errors of what was held out: each pose in turn, then the inner temperatures.
    open_at : float or None
        The condition number for which it is not scored: of all poses, or of what a turn leaves.
    """

    trial: TableTrial
    fit: TableFit
    own_g: FloatArray
    held_out_g: float | None
    errors_g: FloatArray | None = None
    open_at: float | None = None

    @property
    def fitted_g(self) -> float:
        """Fit residual, rms a component."""
        return float(np.sqrt(np.mean(self.own_g**2)))

    def candidate(self, *, chosen: bool) -> Candidate:
        """Row of the table of candidates."""
        return Candidate(
            estimator=self.trial.way,
            shape=self.trial.shape,
            parameters=self.trial.parameters,
            held_out_g=self.held_out_g,
            fit_residual_g=self.fitted_g,
            chosen=chosen,
            label=self.trial.label,
            short_label=self.trial.label,
            condition=self.fit.condition,
        )


def turns(poses: TablePoses, temperatures: Sequence[Sequence[int]]) -> list[BoolArray]:
    """Masks of what is held out: each pose, then each inner temperature of four and more."""
    count = len(poses.readings)
    inner = temperatures[1:-1] if len(temperatures) >= 4 else ()
    masks = []
    for group in (*([k] for k in range(count)), *inner):
        mask = np.zeros(count, dtype=np.bool_)
        mask[list(group)] = True
        masks.append(mask)
    return masks


def judge_table(trial: TableTrial, poses: TablePoses, left_out: Sequence[BoolArray]) -> TableRow:
    """Fit a trial to all poses, and to what each turn leaves."""
    fit = trial.fit(poses, left_out)
    own = fit.force_g(poses) - poses.force
    if fit.full is not None:
        found = fit.full.errors_g
        held_out = None if found is None else float(np.sqrt(np.mean(found**2)))
        return TableRow(trial, fit, own, held_out, found)
    own_max, turn_max = (OPEN, OPEN) if trial.quadratic else (CONDITION_MAX, LEFT_OUT_MAX)
    if fit.condition > own_max or 3 * (len(own) - 1) < trial.parameters:
        return TableRow(trial, fit, own, None, open_at=fit.condition)
    errors = []
    for mask in left_out:
        try:
            part = trial.fit(poses.select(~mask))
        except np.linalg.LinAlgError:  # singular to the last digit
            return TableRow(trial, fit, own, None, open_at=np.inf)
        if part.condition > turn_max:
            return TableRow(trial, fit, own, None, open_at=part.condition)
        out = poses.select(mask)
        errors.append(part.force_g(out) - out.force)
    every = np.concatenate(errors)
    return TableRow(trial, fit, own, float(np.sqrt(np.mean(every**2))), every)


def thermal_design(shape: ThermalShape, gains: int, poses: TablePoses) -> FloatArray:
    """Design of the forward form over temperature, shape (n, 3 gains + P)."""
    basis = shape.basis(poses.temps_degc)
    of_gain = (poses.target[:, :, None] * basis[:, None, :gains]).reshape(len(basis), -1)
    return np.concatenate([of_gain, basis], axis=1)


def _forward_over_temperature(shape: ThermalShape, gains: int, poses: TablePoses) -> TableFit:
    design = thermal_design(shape, gains, poses)
    solution = np.linalg.lstsq(design, poses.readings, rcond=None)[0].T
    constants = np.zeros((12, shape.parameters))
    constants[:9, :gains] = solution[:, : 3 * gains].reshape(9, gains)
    constants[9:] = solution[:, 3 * gains :]
    known = _with_known(None, poses.known)
    return TableFit(shape, constants, known, scaled_condition(design))


def _all_terms(
    trial: TableTrial, priors: Priors, poses: TablePoses, left_out: Sequence[BoolArray]
) -> TableFit:
    """All terms, from the constants of the forward form."""
    start = _forward_over_temperature(trial.shape, trial.gains, poses)
    basis = trial.shape.basis(poses.temps_degc)
    problem = AllTerms(poses.readings, poses.force, basis, trial.gains, poses.known)
    found = fit_full(problem, start.constants, priors, left_out)
    quadratic = found.quadratic + poses.known
    return TableFit(trial.shape, found.constants, quadratic, found.condition, found)


def _with_known(quadratic: FloatArray | None, known: FloatArray) -> FloatArray | None:
    if not known.any():
        return quadratic
    return known if quadratic is None else quadratic + known
