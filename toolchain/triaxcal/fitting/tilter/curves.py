"""Curves of the twelve constants from all readings at once: estimator and thermal fit together.

The dwells of a group lie at slightly different temperatures, and 0.05 degC at the 1.2e-4 V/degC of
the tables of P1 is already 10 micro-g. So a reading stands for its group's temperature only after
being shifted along the curve: U' = U - (f(T_dwell) - f(T_group)), f the fitted output in that
position. The curve needs the shifted readings and the shift needs the curve: rounds of fitting and
shifting converge within two to four rounds (each gains the ratio of the spread inside a group to
the distance of the groups), and all is linear, so the limit is solved for directly:

    theta = G (U - S theta)   =>   (1 + G S) theta = G U.

Per output, U (6 G) are its readings, theta (4 P) the parameters of the curves of its four
constants, G (4 P, 6 G) the estimator followed by the thermal fit, S (6 G, 4 P) the shift. With
equal temperatures in each group S = 0, nothing is solved, and the readings are used as they are.

The thermal fit of each constant is least squares over its points, weighted by their variances.
Inside, the basis is made orthonormal over the groups' temperatures, so the normal matrix is no
worse conditioned than the weights are uneven.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from triaxcal.fitting.core.grouping import GroupedReadings
from triaxcal.fitting.tilter.estimators import design_matrix, pack_rows
from triaxcal.model.thermal.shape import ThermalShape
from triaxcal.model.types import FloatArray


@dataclass(frozen=True)
class TilterData:
    """Readings and the estimators' operators on them.

    Attributes
    ----------
    readings : GroupedReadings
    operators : array, shape (E, G, 3, 4, 6)
        `tilter.estimator_operators` of E estimators.
    gravity_g : float
    """

    readings: GroupedReadings
    operators: FloatArray
    gravity_g: float

    @cached_property
    def design(self) -> FloatArray:
        """Design matrix of the six positions, shape (6, 4)."""
        return design_matrix(self.gravity_g)

    @cached_property
    def by_group(self) -> FloatArray:
        """The operators as (E, 3, 4, G, 6)."""
        return self.operators.transpose(0, 2, 3, 1, 4)

    @cached_property
    def point_variance(self) -> FloatArray:
        """Relative variances of the constants at each temperature, shape (E, 3, 4, G)."""
        squares = self.by_group**2
        if self.readings.variance_v2 is None:
            by_output = np.ones(1)
        else:
            by_output = self.readings.variance_v2.transpose(2, 0, 1)[:, None]
        variance: FloatArray = np.sum(squares * by_output, axis=-1)
        return variance

    def select(self, groups: list[int]) -> TilterData:
        """Only the groups with these indices."""
        return TilterData(self.readings.select(groups), self.operators[:, groups], self.gravity_g)

    def only(self, estimator: int) -> TilterData:
        """Only the estimator with this index."""
        return TilterData(self.readings, self.operators[estimator : estimator + 1], self.gravity_g)


def fit_curves(data: TilterData, shape: ThermalShape) -> FloatArray:
    """Parameters of the twelve curves, shape (E, 12, P), one set an estimator."""
    system = _System.of(data, shape)
    voltage = data.readings.voltage_v
    by_output = voltage.reshape(-1, 3).T[..., None]
    return system.parameters(system.solve(system.fit @ by_output))


def parameter_covariance(
    data: TilterData, shape: ThermalShape, variance_v2: FloatArray
) -> FloatArray:
    """Covariance of the parameters, shape (E, 3, 4, P, 4, P), for variances (G, 6, 3).

    Axes: estimator, output, (constant of the output, parameter) twice; the four constants are
    K_ix, K_iy, K_iz, U0_i. Outputs are independent of each other.
    """
    system = _System.of(data, shape)
    operator = system.solve(system.fit)
    by_output = variance_v2.reshape(-1, 3).T[:, None, :]
    covariance = (operator * by_output) @ np.swapaxes(operator, -1, -2)
    P = shape.parameters
    blocks = covariance.reshape(*covariance.shape[:-2], 4, P, 4, P)
    to_basis = system.to_basis
    result: FloatArray = np.einsum("pr,...krls,qs->...kplq", to_basis, blocks, to_basis)
    return result


def parameter_operator(data: TilterData, shape: ThermalShape) -> FloatArray:
    """L of theta = L U, shape (E, 3, 4, P, 6 G): an output's parameters are linear in its readings.

    Axes: estimator, output, constant of the output, parameter, reading (position within group).
    """
    system = _System.of(data, shape)
    operator = system.solve(system.fit)
    blocks = operator.reshape(*operator.shape[:2], 4, shape.parameters, -1)
    result: FloatArray = system.to_basis @ blocks
    return result


def shifted_voltage(
    readings: GroupedReadings, shape: ThermalShape, parameters: FloatArray, gravity_g: float
) -> FloatArray:
    """Readings brought to their group's temperature along curves (12, P), shape (G, 6, 3)."""
    change = _basis_change(readings, shape)
    slopes = change @ parameters.T
    K = slopes[..., :9].reshape(*slopes.shape[:-1], 3, 3)
    force = design_matrix(gravity_g)[:, :3]
    shift = (K @ force[..., None])[..., 0] + slopes[..., 9:]
    shifted: FloatArray = readings.voltage_v - shift
    return shifted


def _basis_change(readings: GroupedReadings, shape: ThermalShape) -> FloatArray:
    """Basis at each dwell minus basis at its group, shape (G, 6, P)."""
    at_groups = shape.basis(readings.temps_degc)[:, None, :]
    return shape.basis(readings.dwell_temps_degc) - at_groups


@dataclass(frozen=True)
class _System:
    """(1 + G S) theta = G U of one shape, theta in the orthonormal basis.

    `fit` is G, shape (E, 3, 4 P, 6 G); `matrix` is 1 + G S, or None when S = 0; `to_basis` (P, P)
    turns parameters into those of the shape's own basis.
    """

    fit: FloatArray
    matrix: FloatArray | None
    to_basis: FloatArray

    @staticmethod
    def of(data: TilterData, shape: ThermalShape) -> _System:
        readings = data.readings
        Q, R = np.linalg.qr(shape.basis(readings.temps_degc))
        to_basis: FloatArray = np.linalg.inv(R)
        thermal = _thermal_operators(Q, data.point_variance)
        P, G = shape.parameters, len(readings.temps_degc)
        fit = thermal[..., None] * data.by_group[..., None, :, :]
        fit = fit.reshape(*fit.shape[:2], 4 * P, 6 * G)
        change = _basis_change(readings, shape)
        if not change.any():
            return _System(fit, None, to_basis)
        shift = data.design[:, :, None] * (change @ to_basis)[:, :, None, :]
        matrix = np.eye(4 * P) + fit @ shift.reshape(6 * G, 4 * P)
        return _System(fit, matrix, to_basis)

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve for columns `right`, shape (E, 3, 4 P, n)."""
        if self.matrix is None:
            return right
        return np.linalg.solve(self.matrix, right).astype(np.float64, copy=False)

    def parameters(self, theta: FloatArray) -> FloatArray:
        """Parameters (E, 12, P) in the shape's basis of theta (E, 3, 4 P, 1)."""
        P = self.to_basis.shape[0]
        rows = theta.reshape(-1, 3, 4, P) @ self.to_basis.T
        return pack_rows(rows.transpose(0, 3, 1, 2)).swapaxes(-1, -2)


def _thermal_operators(Q: FloatArray, variance: FloatArray) -> FloatArray:
    """Points to parameters in the orthonormal basis Q (G, P): shape (E, 3, 4, P, G)."""
    G, P = Q.shape
    if G == P:
        # Determined: weights do not matter, and the transpose is the exact inverse.
        return np.broadcast_to(Q.T, (*variance.shape[:-1], P, G))
    weighted = Q.T / (variance / variance.min(axis=-1, keepdims=True))[..., None, :]
    solution: FloatArray = np.linalg.solve(weighted @ Q, weighted)
    return solution
