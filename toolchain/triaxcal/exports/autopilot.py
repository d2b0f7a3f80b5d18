"""What the calibration of an autopilot can say of a unit: a_i = s_i (r_i - d_i(T)), axis by axis.

r is the reading in m/s^2 by a nominal sensitivity, s a constant scale factor and d an offset, a
polynomial in T. There are no cross terms, no scale factor over temperature and no terms beyond.
With U = K(T) f + U0(T) and r = c U, the error of axis i for a force f is

    (s c K_ii - 1) f_i + s c sum_(j != i) K_ij f_j + s (c U0_i - d_i)

Over forces of one size in all directions the mean square of the first two terms is least for
s = <K_ii> / (c <|K_i|^2>), <> being the mean over the working range. d is the least-squares
polynomial of c U0_i over the range.

A gyro has no scale factor, s = 1: w_i = r_i - d_i(T), and nothing for the g-sensitivity G, with
U = K(T) (w + G f) + U0(T).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.exports.triad import Gyro, Triad, directions
from triaxcal.model.metrological import force_from_voltage, unpack_constants
from triaxcal.model.types import FloatArray
from triaxcal.unit.site import STANDARD_GRAVITY_M_PER_S2

TURNING_DEG_PER_S = 100.0
"""Rate at which the cost of a gyro's model is stated."""


@dataclass(frozen=True)
class AxisModel:
    """Parameters of an autopilot's model, as it evaluates them.

    Attributes
    ----------
    per_reading : array, shape (3,)
        c: m/s^2 or rad/s of one unit of the readings, with its sign. The driver multiplies by it.
    scale : array, shape (3,)
        s.
    offset : array, shape (order + 1, 3)
        Of d in m/s^2 or rad/s, by powers of T - reference_degc, the constant first.
    reference_degc : float
    range_degc : tuple of two floats
        Temperatures outside are clamped.
    """

    per_reading: FloatArray
    scale: FloatArray
    offset: FloatArray
    reference_degc: float
    range_degc: tuple[float, float]

    def offset_at(self, temp_degc: FloatArray | float) -> FloatArray:
        """d (..., 3) in m/s^2 or rad/s at temperatures of shape (...)."""
        delta = np.clip(temp_degc, *self.range_degc) - self.reference_degc
        powers = np.asarray(delta)[..., None] ** np.arange(len(self.offset))
        result: FloatArray = powers @ self.offset
        return result

    def force_g(self, readings: FloatArray, temp_degc: FloatArray) -> FloatArray:
        """Specific force (n, 3) in g of readings (n, 3) at temperatures (n,)."""
        reading = readings * self.per_reading
        result: FloatArray = self.scale * (reading - self.offset_at(temp_degc))
        return result / STANDARD_GRAVITY_M_PER_S2


@dataclass(frozen=True)
class Loss:
    """A model at the dwells: errors in g, and the component differences to the fitted model."""

    what: str
    length_largest_g: float
    length_rms_g: float
    component_largest_g: float


@dataclass(frozen=True)
class GyroLoss:
    """A model of a gyro: its largest error of a component at rest, under 1 g, and while turning."""

    what: str
    at_rest_rad_per_s: float
    turning_rad_per_s: float


def fit_axis_model(triad: Triad, reference_degc: float, order: int) -> AxisModel:
    """The model of an autopilot that fits best over the working range, all directions alike."""
    _, K, _ = triad.over_range()
    diagonal = np.einsum("tii->ti", K).mean(axis=0)
    scale = diagonal / (K**2).sum(axis=2).mean(axis=0) * STANDARD_GRAVITY_M_PER_S2
    return _with_offset(triad, scale / triad.per_reading, reference_degc, order)


def fit_gyro_offset(triad: Triad, reference_degc: float, order: int) -> AxisModel:
    """The same of a gyro, which has no scale factor."""
    return _with_offset(triad, np.ones(3), reference_degc, order)


def _with_offset(triad: Triad, scale: FloatArray, reference_degc: float, order: int) -> AxisModel:
    temps, _, U0 = triad.over_range()
    order = order if temps[-1] > temps[0] else 0
    powers = (temps - reference_degc)[:, None] ** np.arange(order + 1)
    bias = U0 * triad.per_reading
    middle = bias[len(bias) // 2]  # off it, a constant bias has coefficients of exactly 0
    offset: FloatArray = np.linalg.lstsq(powers, bias - middle, rcond=None)[0].astype(np.float64)
    offset[0] += middle
    return AxisModel(triad.per_reading, scale, offset, reference_degc, triad.range_degc)


def losses(triad: Triad, model: AxisModel, label: str) -> tuple[Loss, ...]:
    """What each simplification costs at the triad's samples."""
    samples = triad.samples
    readings, temps, full = samples.readings, samples.temps_degc, samples.full
    K, U0 = unpack_constants(triad.thermal.constants_at(temps))
    _, over_range, _ = triad.over_range()
    alone = np.einsum("tii->ti", K) / (K**2).sum(axis=2)
    constant = np.linalg.solve(over_range.mean(axis=0), (readings - U0).T).T
    per_g = model.per_reading * model.scale / STANDARD_GRAVITY_M_PER_S2
    bias = model.offset_at(temps) / model.per_reading
    found = (
        ("the fitted model", full),
        ("without cross terms", (readings - U0) * alone),
        ("K constant over temperature", constant),
        (_bias_words(model), force_from_voltage(_with(K, bias), readings)),
        (f"all of this: {label}", (readings - bias) * per_g),
    )
    return tuple(_loss(what, force, full, triad.gravity_g) for what, force in found)


def gyro_losses(gyro: Gyro, model: AxisModel, label: str) -> tuple[GyroLoss, ...]:
    """What each simplification of a gyro costs: under 1 g, and at `TURNING_DEG_PER_S`."""
    triad, G = gyro.triad, gyro.g_sensitivity
    temps = triad.samples.temps_degc
    unit = np.tile(directions(), (len(temps) // 26, 1))
    K, U0 = unpack_constants(triad.thermal.constants_at(temps))
    turning = np.deg2rad(TURNING_DEG_PER_S) * unit
    bias = U0 * triad.per_reading - model.offset_at(temps)
    by_force = unit @ G.T
    by_turning = np.einsum("nij,nj->ni", K, turning) * triad.per_reading - turning
    force_read = np.einsum("nij,nj->ni", K, by_force) * triad.per_reading
    none = np.zeros_like(unit)
    found = (
        ("without g-sensitivity", by_force, none),
        ("without scale factors and cross terms", none, by_turning),
        (_bias_words(model), bias, bias),
        (f"all of this: {label}", bias + force_read, bias + by_turning),
    )
    return tuple(
        GyroLoss(what, float(np.abs(rest).max()), float(np.abs(turned).max()))
        for what, rest, turned in found
    )


def _bias_words(model: AxisModel) -> str:
    return f"bias of order {len(model.offset) - 1}"


def _with(K: FloatArray, U0: FloatArray) -> FloatArray:
    return np.concatenate([K.reshape(-1, 9), U0], axis=-1)


def _loss(what: str, force: FloatArray, full: FloatArray, gravity_g: float) -> Loss:
    error = np.linalg.norm(force, axis=1) - gravity_g
    largest = float(np.abs(force - full).max())
    return Loss(what, float(np.abs(error).max()), float(np.sqrt((error**2).mean())), largest)
