"""A delivered calibration as the prior, brought up to date by a few poses of |a| = g.

The parameters are those of the constants' curves, in the order of `CONSTANT_NAMES`, and Q where its
covariance is known. The prior is the calibration with its covariance and an allowance for drift:

    dK = K(T0) S,    dU0 = K(T0) b,

S symmetric (scales on its diagonal, half angles off it) and b the biases in g, each zero-mean and
alike at all temperatures. The posterior is `fitting.core.posterior`'s; |a| sees no rotation, so a
rotation of the frame stays as it was.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.core.posterior import Posterior, Prior, fit_map
from triaxcal.fitting.field.force import length_slopes
from triaxcal.fitting.field.poses import FieldPoses
from triaxcal.model.metrological import force_from_voltage, unpack_constants
from triaxcal.model.terms import products
from triaxcal.model.types import FloatArray
from triaxcal.unit.limits import Limits

_SCALE_OF_BIAS, _AXES_OF_BIAS = 0.25, 0.1
"""Of the biases' drift in g: that of the scales, of the angles in rad. Data sheets of MEMS sensors
state a sensitivity over life that is a quarter to a third of their zero-g offset's, in g per g."""


@dataclass(frozen=True)
class Drift:
    """Standard deviations of what a sensor may have drifted by.

    Attributes
    ----------
    bias_g : float
        Of each bias.
    scale : float
        Of each scale, relative.
    axes_rad : float
        Of each angle between two axes.
    """

    bias_g: float
    scale: float
    axes_rad: float


def default_drift(limits: Limits) -> Drift:
    """Drift of a unit that keeps its limits: two standard deviations of a bias are the limit."""
    bias_g = limits.over_range_g / 2.0
    return Drift(bias_g, _SCALE_OF_BIAS * bias_g, _AXES_OF_BIAS * bias_g)


@dataclass(frozen=True)
class State:
    """Parameters of a calibration as one vector.

    Attributes
    ----------
    calibration : Calibration
    theta : array, shape (12 P,) or (12 P + 18,)
        With Q row by row where its covariance is known. A calibration that leaves Q out has it
        at 0: it is uncertain, and correlated with the constants, all the same.
    """

    calibration: Calibration
    theta: FloatArray

    @property
    def functions(self) -> int:
        """P."""
        return self.calibration.shape.parameters

    def curves(self, theta: FloatArray) -> FloatArray:
        """Constants' parameters, shape (12, P)."""
        return theta[: 12 * self.functions].reshape(12, self.functions)

    def quadratic(self, theta: FloatArray) -> FloatArray | None:
        """Q, shape (3, 6), or None."""
        rest = theta[12 * self.functions :]
        return rest.reshape(3, 6) if len(rest) else self.calibration.terms.quadratic_per_g

    def delivered(self, theta: FloatArray) -> FloatArray:
        """Theta as the C computes it: without Q where the calibration had none."""
        if self.calibration.terms.quadratic_per_g is not None:
            return theta
        result = theta.copy()
        result[12 * self.functions :] = 0.0
        return result

    def length(
        self, theta: FloatArray, readings: FloatArray, temps_degc: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """|a| at readings (n, 3), (n,), in g, and its derivative by theta, (n, parameters)."""
        basis = self.calibration.shape.basis(temps_degc)
        constants, Q = basis @ self.curves(theta).T, self.quadratic(theta)
        linear = force_from_voltage(constants, readings)
        force = linear if Q is None else linear + products(linear) @ Q.T
        rows = length_slopes(Q, linear, force)
        by_output = np.einsum("ni,nij->nj", rows, np.linalg.inv(unpack_constants(constants)[0]))
        of_gain = -(by_output[:, :, None] * linear[:, None, :]).reshape(len(linear), 9)
        twelve = np.concatenate([of_gain, -by_output], axis=1)
        columns = [(twelve[:, :, None] * basis[:, None, :]).reshape(len(linear), -1)]
        length = np.linalg.norm(force, axis=1)
        if len(theta) > 12 * self.functions:
            unit = force / length[:, None]
            columns.append((unit[:, :, None] * products(linear)[:, None, :]).reshape(-1, 18))
        return length, np.concatenate(columns, axis=1)


def state_of(calibration: Calibration) -> State:
    """Parameters of a calibration: its curves in the functions of its shape, and its Q.

    Q is among them where its uncertainty is known: by the fit, own-axis squares or a pair.
    """
    shape = calibration.shape
    temps = np.linspace(*calibration.range_degc, 8 * shape.parameters + 1)
    temps = np.unique([*temps, calibration.thermal.t0_degc])
    values = calibration.thermal.constants_at(temps)
    curves = np.linalg.lstsq(shape.basis(temps), values, rcond=None)[0].T
    recording, Q = calibration.recording, calibration.terms.quadratic_per_g
    known = recording is not None and recording.terms.quadratic is not None
    known |= calibration.pair is not None
    known |= calibration.squares is not None and calibration.squares.included
    rest = np.zeros(18 if known else 0) if Q is None or not known else Q.ravel()
    return State(calibration, np.concatenate([curves.ravel(), rest]))


def fit_covariance(state: State) -> FloatArray:
    """Covariance of theta by the fit alone."""
    calibration, P, size = state.calibration, state.functions, len(state.theta)
    covariance = np.zeros((size, size))
    recording = calibration.recording
    if recording is not None:
        covariance[: 12 * P, : 12 * P] = recording.covariance.reshape(12 * P, 12 * P)
        if size > 12 * P and recording.terms.cross is not None:
            cross = recording.terms.cross.reshape(12 * P, 18)
            covariance[: 12 * P, 12 * P :], covariance[12 * P :, : 12 * P] = cross, cross.T
            covariance[12 * P :, 12 * P :] = recording.terms.quadratic
    else:
        block = np.zeros((12, P, 12, P))
        for i in range(3):
            rows = np.array([3 * i, 3 * i + 1, 3 * i + 2, 9 + i])
            own = calibration.parameter_covariance[i]
            for k, row in enumerate(rows):
                block[row][:, rows] = own[k]
        covariance[: 12 * P, : 12 * P] = block.reshape(12 * P, 12 * P)
    return covariance


def drift_covariance(state: State, drift: Drift) -> FloatArray:
    """Covariance of theta that an allowance for drift adds."""
    t0 = state.calibration.thermal.t0_degc
    K = unpack_constants(state.calibration.thermal.constants_at(t0))[0]
    columns = []
    for i in range(3):
        bias = np.zeros(12)
        bias[9:] = K[:, i] * drift.bias_g
        columns.append(bias)
        for j in range(i, 3):
            S = np.zeros((3, 3))
            S[i, j] = S[j, i] = drift.scale if i == j else drift.axes_rad / 2.0
            columns.append(np.concatenate([(K @ S).ravel(), np.zeros(3)]))
    factor = np.array(columns).T
    return alike(state, factor @ factor.T)


def alike(state: State, covariance: FloatArray) -> FloatArray:
    """Covariance of theta of errors that are alike at all temperatures.

    Parameters
    ----------
    covariance : array, shape (12, 12) or (30, 30)
        Of the constants, and of Q row by row; that of Q counts where theta has Q.
    """
    P, shape = state.functions, state.calibration.shape
    temps = np.linspace(*state.calibration.range_degc, 8 * P + 1)
    basis = shape.basis(temps)
    ones = np.linalg.lstsq(basis, np.ones(len(basis)), rcond=None)[0]
    spread = np.zeros((len(state.theta), len(covariance)))
    spread[: 12 * P, :12] = np.kron(np.eye(12), ones[:, None])
    if len(state.theta) > 12 * P and len(covariance) > 12:
        spread[12 * P :, 12:] = np.eye(18)
    result: FloatArray = spread @ covariance @ spread.T
    return result


@dataclass(frozen=True)
class Innovation:
    """Poses against a prior, linear about the most probable parameters.

    Attributes
    ----------
    error_g : array, shape (n,)
        |a| - g by the calibration.
    covariance : array, shape (n, n)
        Of these errors: prior, drift, noise.
    """

    error_g: FloatArray
    covariance: FloatArray

    @property
    def chi_square(self) -> float:
        """r^T S^-1 r."""
        return float(self.error_g @ np.linalg.solve(self.covariance, self.error_g))

    @property
    def left_out(self) -> tuple[FloatArray, FloatArray]:
        """Each error against what the prior and the others predict, and its sd, (n,) both, g."""
        inverse = np.linalg.inv(self.covariance)
        diagonal = np.diag(inverse)
        return (inverse @ self.error_g) / diagonal, 1.0 / np.sqrt(diagonal)


def innovation(
    state: State,
    covariance: FloatArray,
    poses: FieldPoses,
    noise: FloatArray,
    gravity_g: float,
    *,
    theta: FloatArray,
) -> Innovation:
    """Poses against a prior of this covariance; `noise` (n, n) is that of |a| in the poses.

    About the most probable `theta`, chi-square is what the update has minimised, whatever the size
    of the change: a bias that moved by 50 mg moves |a| across it by its square, 1.25 mg.
    """
    length, slopes = state.length(theta, poses.readings, poses.temps_degc)
    error = length - gravity_g + slopes @ (state.theta - theta)
    return Innovation(error, slopes @ covariance @ slopes.T + noise)


def updated(
    state: State, covariance: FloatArray, poses: FieldPoses, noise: FloatArray, gravity_g: float
) -> Posterior:
    """The most probable parameters after the poses, and what is known of them."""
    whiten = np.linalg.inv(np.linalg.cholesky(noise))

    def model(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        length, slopes = state.length(theta, poses.readings, poses.temps_degc)
        return whiten @ (length - gravity_g), whiten @ slopes

    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    unit = covariance / np.outer(scale, scale)
    root = Prior.of(np.zeros(len(scale)), unit).factor * scale[:, None]
    return fit_map(model, Prior(state.theta, root), np.ones(len(poses)), scale=1.0)
