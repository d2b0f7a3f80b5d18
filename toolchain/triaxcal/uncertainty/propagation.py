"""How errors of readings become errors of the constants and of the compensated acceleration.

The fit is linear in the readings (docs/explanation/theory.md, Thermal curves): the constants of
output i at T are c_i(T) = C_i(T) U_i, C_i (4, 6 G). An error of the constants is an error of the
force,

    da = -N (dK a + dU0) = D [a; 1],    D = -N [dK dU0]    (3 x 4),

so covariances are kept of the twelve entries of [K U0] and of D, both row by row: x's three and
its bias, y's, z's (`ROWS` turns them into the order of `CONSTANT_NAMES`). An error that does not
depend on a stands in the last column of D.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.core.grouping import group_dwells, grouped_readings
from triaxcal.fitting.tilter.curves import TilterData, parameter_operator, shifted_voltage
from triaxcal.fitting.tilter.estimators import estimator_operators
from triaxcal.fitting.tilter.squares import straight
from triaxcal.model.metrological import unpack_constants
from triaxcal.model.positions import TEST_POSITIONS
from triaxcal.model.types import FloatArray
from triaxcal.readings.measurements import MeasurementSet
from triaxcal.unit.description import UnitDescription

RADIANS_PER_ARCSEC = np.pi / 180.0 / 3600.0
ROWS = (0, 1, 2, 4, 5, 6, 8, 9, 10, 3, 7, 11)
"""Where each constant of `CONSTANT_NAMES` stands in the twelve of a covariance here."""
_FORCES = np.array(list(TEST_POSITIONS.values()), dtype=np.float64)
_STEP_DEGC = 0.01


@dataclass(frozen=True)
class Curves:
    """One unit's constants at temperatures `temps_degc`, shape (n,), wherever they are from."""

    unit: UnitDescription
    measurements: MeasurementSet
    calibration: Calibration
    temps_degc: FloatArray

    @cached_property
    def rows(self) -> FloatArray:
        """[K U0] at `temps_degc`, shape (n, 3, 4)."""
        return rows_of(self.calibration.thermal.constants_at(self.temps_degc))

    @cached_property
    def inverse(self) -> FloatArray:
        """N at `temps_degc`, shape (n, 3, 3), g/V."""
        return np.linalg.inv(self.rows[:, :, :3]).astype(np.float64)

    @cached_property
    def slopes(self) -> FloatArray:
        """Change of [K U0] per degC, shape (n, 3, 4)."""
        at = self.calibration.thermal.constants_at
        change = at(self.temps_degc + _STEP_DEGC) - at(self.temps_degc - _STEP_DEGC)
        return rows_of(change / (2.0 * _STEP_DEGC))

    def force_factor(self, constants: FloatArray) -> FloatArray:
        """Factor of D, shape (n, 12, m), of one of [K U0] of the same shape."""
        blocks = constants.reshape(len(self.temps_degc), 3, 4, -1)
        D = -np.einsum("nij,njkm->nikm", self.inverse, blocks)
        result: FloatArray = D.reshape(constants.shape)
        return result


@dataclass(frozen=True)
class Propagation(Curves):
    """The tilter's linear propagation on top."""

    data: TilterData

    @cached_property
    def parameter_operator(self) -> FloatArray:
        """Shape (3, 4, P, 6 G)."""
        operator: FloatArray = parameter_operator(self.data, self.calibration.shape)[0]
        return operator

    def constants_operator(self, temps_degc: FloatArray) -> FloatArray:
        """C at temperatures (m,), shape (m, 3, 4, 6 G)."""
        basis = self.calibration.shape.basis(temps_degc)
        result: FloatArray = np.einsum("np,ikpr->nikr", basis, self.parameter_operator)
        return result

    @cached_property
    def operator(self) -> FloatArray:
        """C at `temps_degc`, shape (n, 3, 4, 6 G)."""
        return self.constants_operator(self.temps_degc)

    @cached_property
    def forces_g(self) -> FloatArray:
        """Force in the dwells, shape (6 G, 3)."""
        return np.tile(_FORCES * self.unit.gravity_g, (self.groups, 1))

    @property
    def groups(self) -> int:
        """G: calibrated temperatures."""
        return len(self.data.readings.temps_degc)

    @cached_property
    def dwell_gain(self) -> FloatArray:
        """K at the dwells, shape (6 G, 3, 3), V/g."""
        temps = self.data.readings.dwell_temps_degc.reshape(-1)
        K: FloatArray = unpack_constants(self.calibration.thermal.constants_at(temps))[0]
        return K

    @cached_property
    def tilt_effect(self) -> FloatArray:
        """Change of the readings by a tilt of each dwell about axis q, (6 G, 3, q), V/rad."""
        # Row q of the cross products is e_q x a.
        turned = np.cross(np.eye(3)[None], self.forces_g[:, None])
        result: FloatArray = np.einsum("rij,rqj->riq", self.dwell_gain, turned)
        return result

    @cached_property
    def shifted(self) -> FloatArray:
        """Readings brought to their groups' temperatures, shape (G, 6, 3), V."""
        readings, shape = self.data.readings, self.calibration.shape
        by_output = readings.voltage_v.reshape(-1, 3)
        rows = np.einsum("ikpr,ri->ikp", self.parameter_operator, by_output)
        parameters = rows.reshape(12, -1)[list(ROWS)]
        return shifted_voltage(readings, shape, parameters, self.unit.gravity_g)

    def constants_factor(self, readings_v: FloatArray) -> FloatArray:
        """Factor of [K U0], (n, 12, m), of m errors of the readings (6 G, 3, m) in V."""
        factor = np.einsum("nikr,rim->nikm", self.operator, readings_v)
        result: FloatArray = factor.reshape(len(self.temps_degc), 12, -1)
        return result


def propagation(
    unit: UnitDescription,
    measurements: MeasurementSet,
    calibration: Calibration,
    temps_degc: FloatArray,
) -> Propagation:
    """Propagation of a unit that has been calibrated from these measurements."""
    groups = group_dwells(measurements, unit.t0_degc)
    groups = straight(groups, calibration.terms, unit.gravity_g)
    readings = grouped_readings(groups, unit.adc.volts_per_code)
    operators = estimator_operators(
        calibration.estimator, unit.gravity_g, readings.variance_v2, len(groups)
    )
    data = TilterData(readings, operators[None], unit.gravity_g)
    return Propagation(unit, measurements, calibration, temps_degc, data)


def rows_of(constants: FloatArray) -> FloatArray:
    """Constants (..., 12) in the order of `CONSTANT_NAMES` as [K U0], shape (..., 3, 4)."""
    K, U0 = unpack_constants(constants)
    return np.concatenate([K, U0[..., None]], axis=-1)


def square(factor: FloatArray) -> FloatArray:
    """Covariance (n, 12, 12) of a factor (n, 12, m) of independent errors of unit variance."""
    result: FloatArray = factor @ np.swapaxes(factor, -1, -2)
    return result


def mapped(transform: FloatArray, covariance: FloatArray) -> FloatArray:
    """Covariance of D, (n, 12, 12), of one of [K U0]; `transform` is -N (n, 3, 3)."""
    n = len(covariance)
    blocks = covariance.reshape(n, 3, 4, 3, 4)
    half = np.einsum("nij,njkbl->nikbl", transform, blocks)
    result: FloatArray = np.einsum("nikbl,ncb->nikcl", half, transform).reshape(n, 12, 12)
    return result
