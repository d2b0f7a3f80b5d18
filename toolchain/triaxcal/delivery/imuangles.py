"""How well the angles of an IMU's device are known, by the filter's covariance and its C."""

from __future__ import annotations

import math

import numpy as np

from triaxcal.delivery.imuc import ImuC
from triaxcal.dynamic.blocks import accelasymmetry, accelnonlinearity, thermal
from triaxcal.dynamic.blocks.base import ACCELEROMETER_BIAS, ACCELEROMETER_MATRIX, LOWER
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.overtemperature import GRID, OverTemperature
from triaxcal.dynamic.thermalcurves import joint_covariance_at
from triaxcal.dynamic.unit import DynamicUnit
from triaxcal.model.types import FloatArray
from triaxcal.uncertainty.angles import AngleUncertainty, angle_uncertainty
from triaxcal.uncertainty.evaluate import Uncertainty
from triaxcal.uncertainty.propagation import mapped, rows_of, square
from triaxcal.uncertainty.source import NORMAL, RECTANGULAR, Source
from triaxcal.unit.site import STANDARD_GRAVITY_M_PER_S2

_STATES = 3 + len(LOWER)
"""Constants of the accelerometers that a recording determines: biases, then Gamma by `LOWER`."""
_BIAS, _SLOPE = slice(0, 3), slice(3, 6)
_ROOT_12, _ROOT_3 = math.sqrt(12.0), math.sqrt(3.0)
_STEP_DEGC = 0.01
_NO_CHANGES = "changes of the constants with temperature, of which none was estimated"


def imu_angles(done: DynamicUnit, c: ImuC) -> AngleUncertainty | None:
    """Uncertainty of the angles, at T0 and over the device's range; None where it makes none."""
    choice = c.device.angles
    return None if choice is None else angle_uncertainty(accelerometer_uncertainty(done, c), choice)


def not_in_them(done: DynamicUnit) -> tuple[str, ...]:
    """What that uncertainty does not contain, in words."""
    effects = accelasymmetry.BLOCK, accelnonlinearity.BLOCK
    seen = [block.title for block in effects if block.name in done.result.layout]
    return (
        "the mounting of the unit",
        "the noise of a sample",
        "drift since the recording",
        *(f"{title}, which the C does not correct" for title in seen),
        *([_NO_CHANGES] * constant(done)),
    )


def constant(done: DynamicUnit) -> bool:
    """Whether the accelerometers' constants are the same over the whole range."""
    return done.over is None and thermal.BLOCK.name not in done.result.layout


def accelerometer_uncertainty(done: DynamicUnit, c: ImuC) -> Uncertainty:
    """Of the compensated acceleration at 1 g: constants, rounding of both codes, and the C."""
    temps, t0_index = _temperatures(done, c)
    if done.over is not None:
        covariance = _by_curves(done.over, temps)
    else:
        covariance = _by_states(done.result.layout, done.result.covariance, _warm(done, temps))
    at = c.model.accel.constants_at
    inverse = np.linalg.inv(rows_of(at(temps))[:, :, :3]).astype(np.float64)
    slopes = rows_of((at(temps + _STEP_DEGC) - at(temps - _STEP_DEGC)) / (2.0 * _STEP_DEGC))
    adc, sensor = c.device.accel_adc, c.device.temperature_sensor
    bound, q = c.build.accel_bound.per_axis_lsb, c.build.accel.shape.output_q
    of_c = np.diag(np.array(bound) * 2.0**-q + c.accel_model_error_g) / _ROOT_3
    of_temperature = slopes.reshape(len(temps), 12, 1) * (sensor.degc_per_code / _ROOT_12)
    sources = (
        _source("constants", NORMAL, mapped(-inverse, _of_constants(covariance))),
        _source("raw_code", RECTANGULAR, _direct(inverse * (adc.volts_per_code / _ROOT_12))),
        _source("temperature_code", RECTANGULAR, mapped(-inverse, square(of_temperature))),
        _source("firmware", RECTANGULAR, _direct(np.broadcast_to(of_c, inverse.shape))),
    )
    return Uncertainty(temps, t0_index, sources, None, ())


def _source(key: str, distribution: str, force: FloatArray) -> Source:
    largest = float(np.sqrt(np.diagonal(force, 0, 1, 2).max()))
    return Source(key, key, "g", "", "", largest, distribution, force=force)


def _temperatures(done: DynamicUnit, c: ImuC) -> tuple[FloatArray, int]:
    """Temperatures of the device's range, T0 or the nearest to it among them, and where it is."""
    low, high = c.device.range_degc
    t0 = min(max(done.result.frame.reference_degc, low), high)
    if constant(done):
        return np.array([t0]), 0
    temps = np.unique([*np.linspace(low, high, GRID), t0])
    return temps, int(np.argmin(np.abs(temps - t0)))


def _warm(done: DynamicUnit, temps_degc: FloatArray) -> FloatArray:
    return temps_degc - done.result.frame.reference_degc


def _by_states(layout: Layout, covariance: FloatArray, warm_k: FloatArray) -> FloatArray:
    """Covariance (n, 9, 9) of the accelerometers' constants, SI, by the states of the filter."""
    rows = np.zeros((len(warm_k), _STATES, len(layout)))
    places = (ACCELEROMETER_BIAS.name, _BIAS), (ACCELEROMETER_MATRIX.name, slice(3, _STATES))
    for name, own in places:
        rows[:, own, layout.place(name)] = np.eye(own.stop - own.start)
    if thermal.BLOCK.name in layout:
        start = layout.place(thermal.BLOCK.name).start
        diagonal = [3 + LOWER.index((i, i)) for i in range(3)]
        for i in range(3):
            rows[:, i, start + i] = warm_k
            rows[:, diagonal[i], start + 3 + i] = warm_k
    found: FloatArray = rows @ covariance @ np.swapaxes(rows, 1, 2)
    return found


def _by_curves(over: OverTemperature, temps_degc: FloatArray) -> FloatArray:
    """The same by curves: the correlations of the chosen ones, and the stated deviations.

    Those have what other likely functions differ.
    """
    blocks = ACCELEROMETER_BIAS, ACCELEROMETER_MATRIX
    own = joint_covariance_at(over.choice.fit, blocks, temps_degc)
    known = over.known
    places = [known.names.index(state.name) for block in blocks for state in block.states]
    sd = np.stack([np.interp(temps_degc, known.temps_degc, known.sd[:, k]) for k in places], axis=1)
    wider = sd / np.sqrt(np.diagonal(own, 0, 1, 2))
    found: FloatArray = own * wider[:, :, None] * wider[:, None, :]
    return found


def _of_constants(covariance: FloatArray) -> FloatArray:
    """Covariance (n, 12, 12) of [K U0], readings in g, of one of the states."""
    to = np.zeros((12, _STATES))
    for i in range(3):
        to[4 * i + 3, i] = 1.0 / STANDARD_GRAVITY_M_PER_S2
    for k, (i, j) in enumerate(LOWER):
        to[4 * i + j, 3 + k] = 1.0
    found: FloatArray = to @ covariance @ to.T
    return found


def _direct(factor_g: FloatArray) -> FloatArray:
    """Covariance of D of errors (n, 3, m) of the acceleration that do not depend on it."""
    blocks = np.zeros((len(factor_g), 3, 4, factor_g.shape[-1]))
    blocks[:, :, 3] = factor_g
    return square(blocks.reshape(len(factor_g), 12, -1))
