"""A calibrated triad as far as it concerns the parameters of an autopilot, of a unit or an IMU."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.delivery.fitted import Fitted
from triaxcal.delivery.fittedimu import FittedImu
from triaxcal.fitting.tilter.acceptance import dwells_in_range
from triaxcal.model.curves import ThermalModel
from triaxcal.model.metrological import force_from_voltage, unpack_constants
from triaxcal.model.positions import CHECK_POSITIONS
from triaxcal.model.types import FloatArray
from triaxcal.unit.adc import Adc
from triaxcal.unit.site import STANDARD_GRAVITY_M_PER_S2

GRID = 257
_TEMPERATURES = 9
_IN_M_PER_S2 = {
    "m/s^2": 1.0,
    "g": STANDARD_GRAVITY_M_PER_S2,
    "mg": STANDARD_GRAVITY_M_PER_S2 * 1e-3,
}


@dataclass(frozen=True)
class Samples:
    """Readings at which the cost of a model is stated.

    Attributes
    ----------
    where : str
        What they are.
    readings : array, shape (n, 3)
    temps_degc : array, shape (n,)
    full : array, shape (n, 3)
        What the fitted model makes of them, in the unit of its result.
    """

    where: str
    readings: FloatArray
    temps_degc: FloatArray
    full: FloatArray


@dataclass(frozen=True)
class Triad:
    """A triad over its working range.

    Attributes
    ----------
    thermal : ThermalModel
        K and U0, in units of the readings.
    t0_degc : float
        Where the constants are referred to, within the range.
    range_degc : tuple of two floats
    adc : Adc
        What the codes are.
    reading : str
        Unit of the readings.
    per_reading : array, shape (3,)
        m/s^2 or rad/s of one unit of the readings, with its sign: what the driver gives.
    samples : Samples
    gravity_g : float
        Length of the specific force in `samples`.
    """

    thermal: ThermalModel
    t0_degc: float
    range_degc: tuple[float, float]
    adc: Adc
    reading: str
    per_reading: FloatArray
    samples: Samples
    gravity_g: float = 1.0

    def over_range(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Temperatures (t,), K (t, 3, 3) and U0 (t, 3) evenly over the working range."""
        temps = np.linspace(*self.range_degc, GRID)
        K, U0 = unpack_constants(self.thermal.constants_at(temps))
        return temps, K, U0


@dataclass(frozen=True)
class Gyro:
    """The gyro of an IMU.

    Attributes
    ----------
    triad : Triad
        `samples` are rates.
    g_sensitivity : array, shape (3, 3)
        (rad/s)/g that a specific force adds.
    """

    triad: Triad
    g_sensitivity: FloatArray


def triad_of(fitted: Fitted) -> Triad:
    """The triad of a unit."""
    unit, calibration = fitted.unit, fitted.calibration
    low, high = calibration.range_degc
    return Triad(
        calibration.thermal,
        min(max(unit.t0_degc, low), high),
        (low, high),
        unit.adc,
        calibration.reading_unit,
        _nominal_m_per_s2(fitted),
        _dwells(fitted),
        unit.gravity_g,
    )


def triads_of(imu: FittedImu) -> tuple[Triad, Gyro]:
    """Accelerometer and gyro of an IMU.

    Nothing is held out of the recording of an IMU: the samples are 1 g, or a rate, in 26 directions
    at temperatures of the whole range, by the fitted model.
    """
    device, model = imu.device, imu.model
    where = f"1 g in 26 directions at {_TEMPERATURES} temperatures, by the fitted model"
    accel = Triad(
        model.accel,
        _inside(model.accel.t0_degc, device.range_degc),
        device.range_degc,
        device.accel_adc,
        "g",
        np.full(3, STANDARD_GRAVITY_M_PER_S2),
        _modelled(where, model.accel, device.range_degc, 1.0),
    )
    gyro = Triad(
        model.gyro,
        _inside(model.gyro.t0_degc, device.gyro_range),
        device.gyro_range,
        device.gyro_adc,
        "rad/s",
        np.ones(3),
        _modelled("", model.gyro, device.gyro_range, 0.0),
    )
    return accel, Gyro(gyro, model.g_sensitivity)


def directions() -> FloatArray:
    """Unit vectors to the faces, edges and corners of a cube, shape (26, 3)."""
    grid = np.stack(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    chosen = grid[np.any(grid != 0.0, axis=1)]
    result: FloatArray = chosen / np.linalg.norm(chosen, axis=1)[:, None]
    return result


def _modelled(
    where: str, thermal: ThermalModel, range_degc: tuple[float, float], size: float
) -> Samples:
    """Readings of vectors of one size by the model itself."""
    temps = np.repeat(np.linspace(*range_degc, _TEMPERATURES), 26)
    truth = size * np.tile(directions(), (_TEMPERATURES, 1))
    K, U0 = unpack_constants(thermal.constants_at(temps))
    return Samples(where, np.einsum("nij,nj->ni", K, truth) + U0, temps, truth)


def _inside(value: float, interval: tuple[float, float]) -> float:
    return min(max(value, interval[0]), interval[1])


def _dwells(fitted: Fitted) -> Samples:
    """The dwells in the range; those that were not fitted, where there are any."""
    unit, calibration = fitted.unit, fitted.calibration
    inside = dwells_in_range(unit, calibration.range_degc, fitted.measurements)
    checks = [d for d in inside if d.position in CHECK_POSITIONS]
    dwells = checks or inside
    readings = np.array([d.voltage_v for d in dwells])
    temps = np.array([d.temp_degc for d in dwells])
    force = force_from_voltage(calibration.thermal.constants_at(temps), readings)
    full = calibration.terms.force_g(force, np.array([d.rate_k_per_s for d in dwells]))
    where = "check dwells, which were not fitted" if checks else "dwells of the fit: none held out"
    return Samples(f"{len(dwells)} {where}", readings, temps, full)


def _nominal_m_per_s2(fitted: Fitted) -> FloatArray:
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
