"""Candidates of poses with known angles, P0: each fitted, each judged by poses held out.

At one temperature they are the forms of `oriented`; over temperature the forward form (28) with
polynomials, which is linear in all unknowns: U = sum_p f_p(T) (d0_p + D_p g). Left out in turn is
every pose, and every inner temperature where there are four and more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from triaxcal.fitting.core.calibration import Candidate
from triaxcal.fitting.recorded.checks import CONDITION_MAX
from triaxcal.fitting.recorded.frame import rotation_to, turned_constants
from triaxcal.fitting.recorded.magnitude import fit_scalar
from triaxcal.fitting.recorded.scalar import NINE, scalar_data
from triaxcal.fitting.recorded.temperatures import gain_functions
from triaxcal.fitting.recorded.trials import detail
from triaxcal.fitting.table.oriented import (
    OrientedFit,
    SerialGrid,
    inverse_linear,
    inverse_quadratic,
    scaled_condition,
)
from triaxcal.model.metrological import force_from_voltage, pack_constants
from triaxcal.model.terms import products
from triaxcal.model.thermal.shape import ThermalShape
from triaxcal.model.types import BoolArray, FloatArray

LEFT_OUT_MAX = 10.0 * CONDITION_MAX
"""Of what a turn leaves: it is only to judge, not to ship."""


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
    """

    shape: ThermalShape
    constants: FloatArray
    quadratic: FloatArray | None
    condition: float

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
    """A candidate: label, way and solver; `gains` functions of temperature for K, all for U0."""

    label: str
    way: str
    shape: ThermalShape
    solver: Callable[[FloatArray, FloatArray], OrientedFit] | None
    unknowns: int
    gains: int = 1
    quadratic: bool = False

    @property
    def parameters(self) -> int:
        """Free parameters over all temperatures."""
        if self.solver is not None:
            return self.unknowns
        return 9 * self.gains + 3 * self.shape.parameters

    def fit(self, poses: TablePoses) -> TableFit:
        """Fit to the poses."""
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


def one_temperature_trials(shape: ThermalShape) -> list[TableTrial]:
    """The forms of P0; simpler ones first."""
    return [
        TableTrial("linear (12)", "inverse form", shape, inverse_linear, 12),
        TableTrial("linear (28)", "forward form", shape, _forward, 12),
        TableTrial("nine constants and the turn to the table", "|a| = g", shape, _scalar, 12),
        TableTrial("quadratic (13)", "inverse form", shape, inverse_quadratic, 27, quadratic=True),
        TableTrial("quadratic (29)", "forward form", shape, _forward_quadratic, 27, quadratic=True),
    ]


def thermal_trials(shape: ThermalShape) -> list[TableTrial]:
    """The forward form with a thermal function, and K with fewer functions."""
    return [
        TableTrial(f"linear (28); {detail(shape, n)}", "forward form", shape, None, 0, n)
        for n in gain_functions(shape)
    ]


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
    fit = trial.fit(poses)
    own = fit.force_g(poses) - poses.force
    if fit.condition > CONDITION_MAX or 3 * (len(own) - 1) < trial.parameters:
        return TableRow(trial, fit, own, None)
    errors = []
    for mask in left_out:
        try:
            part = trial.fit(poses.select(~mask))
        except np.linalg.LinAlgError:  # singular to the last digit
            return TableRow(trial, fit, own, None, open_at=np.inf)
        if part.condition > LEFT_OUT_MAX:
            return TableRow(trial, fit, own, None)
        out = poses.select(mask)
        errors.append(part.force_g(out) - out.force)
    every = np.concatenate(errors)
    return TableRow(trial, fit, own, float(np.sqrt(np.mean(every**2))), every)


def _forward(readings: FloatArray, force: FloatArray) -> OrientedFit:
    return SerialGrid.of(force).fit(readings)


def _forward_quadratic(readings: FloatArray, force: FloatArray) -> OrientedFit:
    return SerialGrid.of(force, quadratic=True).fit(readings)


def _scalar(readings: FloatArray, force: FloatArray) -> OrientedFit:
    """|a| = g alone, then turned to the table: what the angles' errors cannot spoil."""
    gravity_g = float(np.linalg.norm(force, axis=1).mean())
    ones = np.ones(len(readings))
    fit = fit_scalar(NINE, scalar_data(readings, ones[:, None], ones, gravity_g), 1)
    found = _oriented(fit.constants()[:, 0], fit.condition)
    rotation = rotation_to(found.force_g(readings), force)
    turned = turned_constants(fit.constants(), rotation)[:, 0]
    return _oriented(turned, fit.condition)


def _oriented(constants: FloatArray, condition: float) -> OrientedFit:
    return OrientedFit(constants[:9].reshape(3, 3), constants[9:], None, condition)


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


def _with_known(quadratic: FloatArray | None, known: FloatArray) -> FloatArray | None:
    if not known.any():
        return quadratic
    return known if quadratic is None else quadratic + known
