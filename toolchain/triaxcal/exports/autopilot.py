"""What the calibration of an autopilot can say of a unit: a_i = s_i (r_i - d_i(T)), axis by axis.

r is the reading in m/s^2 by a nominal sensitivity, s a constant scale factor and d an offset, a
polynomial in T. There are no cross terms, no scale factor over temperature and no terms beyond.
With U = K(T) f + U0(T) and r = c U, the error of axis i for a force f is

    (s c K_ii - 1) f_i + s c sum_(j != i) K_ij f_j + s (c U0_i - d_i)

Over forces of one size in all directions the mean square of the first two terms is least for
s = <K_ii> / (c <|K_i|^2>), <> being the mean over the working range. d is the least-squares
polynomial of c U0_i over the range.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.delivery.fitted import Fitted
from triaxcal.fitting.tilter.acceptance import dwells_in_range
from triaxcal.model.metrological import force_from_voltage, unpack_constants
from triaxcal.model.positions import CHECK_POSITIONS
from triaxcal.model.types import FloatArray
from triaxcal.unit.site import STANDARD_GRAVITY_M_PER_S2

_GRID = 257
_IN_M_PER_S2 = {
    "m/s^2": 1.0,
    "g": STANDARD_GRAVITY_M_PER_S2,
    "mg": STANDARD_GRAVITY_M_PER_S2 * 1e-3,
}


@dataclass(frozen=True)
class AxisModel:
    """Parameters of an autopilot's model, as it evaluates them.

    Attributes
    ----------
    per_reading : array, shape (3,)
        c: m/s^2 of one unit of the readings, with its sign. The driver multiplies by it.
    scale : array, shape (3,)
        s.
    offset : array, shape (order + 1, 3)
        Of d in m/s^2, by powers of T - reference_degc, the constant first.
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
        """d (..., 3) in m/s^2 at temperatures of shape (...)."""
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


def fit_axis_model(fitted: Fitted, reference_degc: float, order: int) -> AxisModel:
    """The model of an autopilot that fits best over the working range, all directions alike."""
    temps, K, U0 = _over_range(fitted)
    per_reading = nominal_m_per_s2(fitted)
    diagonal = np.einsum("tii->ti", K).mean(axis=0)
    scale = diagonal / (K**2).sum(axis=2).mean(axis=0) * STANDARD_GRAVITY_M_PER_S2 / per_reading
    order = order if temps[-1] > temps[0] else 0
    powers = (temps - reference_degc)[:, None] ** np.arange(order + 1)
    offset: FloatArray = np.linalg.lstsq(powers, U0 * per_reading, rcond=None)[0].astype(np.float64)
    return AxisModel(per_reading, scale, offset, reference_degc, fitted.calibration.range_degc)


def nominal_m_per_s2(fitted: Fitted) -> FloatArray:
    """m/s^2 of one unit of the readings, (3,): by their unit, or a nominal sensitivity.

    Where unit.toml states none, it is the mean size of the three at T0, with their signs.
    """
    unit, calibration = fitted.unit, fitted.calibration
    known = _IN_M_PER_S2.get(calibration.reading_unit)
    if known is not None:
        return np.full(3, known)
    nominal = unit.nominal_v_per_g
    if nominal is None:
        K, _ = unpack_constants(calibration.thermal.constants_at(unit.t0_degc))
        diagonal = np.diag(K)
        nominal = tuple(np.sign(diagonal) * np.abs(diagonal).mean())
    return STANDARD_GRAVITY_M_PER_S2 / np.array(nominal)


def losses(fitted: Fitted, model: AxisModel, label: str) -> tuple[str, tuple[Loss, ...]]:
    """Which dwells they are, and what each simplification costs there."""
    unit, calibration = fitted.unit, fitted.calibration
    inside = dwells_in_range(unit, calibration.range_degc, fitted.measurements)
    checks = [d for d in inside if d.position in CHECK_POSITIONS]
    dwells = checks or inside
    readings = np.array([d.voltage_v for d in dwells])
    temps = np.array([d.temp_degc for d in dwells])
    constants = calibration.thermal.constants_at(temps)
    K, U0 = unpack_constants(constants)
    full = calibration.terms.force_g(
        force_from_voltage(constants, readings), np.array([d.rate_k_per_s for d in dwells])
    )
    _, over_range, _ = _over_range(fitted)
    alone = np.einsum("tii->ti", K) / (K**2).sum(axis=2)
    constant = np.linalg.solve(over_range.mean(axis=0), (readings - U0).T).T
    per_g = model.per_reading * model.scale / STANDARD_GRAVITY_M_PER_S2
    bias = model.offset_at(temps) / model.per_reading
    found = (
        ("the fitted model", full),
        ("without cross terms", (readings - U0) * alone),
        ("K constant over temperature", constant),
        (f"bias of order {len(model.offset) - 1}", force_from_voltage(_with(K, bias), readings)),
        (f"all of this: {label}", (readings - bias) * per_g),
    )
    rows = tuple(_loss(what, force, full, unit.gravity_g) for what, force in found)
    where = "check dwells, which were not fitted" if checks else "dwells of the fit: none held out"
    return f"{len(dwells)} {where}", rows


def _with(K: FloatArray, U0: FloatArray) -> FloatArray:
    return np.concatenate([K.reshape(-1, 9), U0], axis=-1)


def _loss(what: str, force: FloatArray, full: FloatArray, gravity_g: float) -> Loss:
    error = np.linalg.norm(force, axis=1) - gravity_g
    largest = float(np.abs(force - full).max())
    return Loss(what, float(np.abs(error).max()), float(np.sqrt((error**2).mean())), largest)


def _over_range(fitted: Fitted) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Temperatures (t,), K (t, 3, 3) and U0 (t, 3) evenly over the working range."""
    calibration = fitted.calibration
    temps = np.linspace(*calibration.range_degc, _GRID)
    K, U0 = unpack_constants(calibration.thermal.constants_at(temps))
    return temps, K, U0
