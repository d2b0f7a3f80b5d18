"""Constants of a sound unit over temperature: their curves, priors and what they predict."""

from __future__ import annotations

from functools import cache

import numpy as np

from triaxcal.diagnosis.core.readings import Readings
from triaxcal.diagnosis.core.scales import Scales
from triaxcal.model.types import FloatArray

ORDERS = 5
"""Coefficients of a curve over (T - T0) / 50 degC."""
_SPAN_DEGC = 50.0
_BEND_DEGC = 10.0
"""Correlation length of what bends faster than the polynomials."""


def _prior_sd() -> tuple[FloatArray, FloatArray]:
    """Of the constants, shape (3, 4, ORDERS): fixed, and to be multiplied by the curvatures."""
    fixed, curved = np.zeros((3, 4, ORDERS)), np.zeros((3, 4, ORDERS))
    for i in range(3):
        fixed[i, 0, :2] = 0.5, 0.03
        curved[i, 0, 2:] = 1e-3, 4e-4, 1.5e-4
        for j in range(3):
            own = i == j
            fixed[i, 1 + j, :2] = (0.05, 0.02) if own else (0.03, 1e-3)
            curved[i, 1 + j, 2:] = (5e-4, 2e-4, 7e-5) if own else (1e-4, 4e-5, 1.5e-5)
    return fixed, curved


_FIXED_SD, _CURVED_SD = _prior_sd()
MEAN = np.zeros((3, 4, ORDERS))
"""Prior mean of the constants: outputs are in g."""
MEAN[(0, 1, 2), (1, 2, 3), 0] = 1.0


def prior_sd(scales: Scales) -> FloatArray:
    """Prior standard deviations of the constants, shape (3 * 4 * ORDERS,); not to be changed."""
    return _prior_sd_of(scales.bias_curvature, scales.curvature)


@cache
def _prior_sd_of(bias_curvature: float, curvature: float) -> FloatArray:
    curvatures = np.array([bias_curvature, *3 * [curvature]])[:, None]
    found = np.asarray(np.hypot(_FIXED_SD, curvatures * _CURVED_SD)).ravel()
    found.flags.writeable = False
    return found


def powers(temps_degc: FloatArray, t0_degc: float) -> FloatArray:
    """Functions of temperature, shape (n, ORDERS)."""
    x = (np.asarray(temps_degc, dtype=np.float64) - t0_degc) / _SPAN_DEGC
    found = np.ones((len(x), ORDERS))
    for order in range(1, ORDERS):  # several times as fast as numpy's power
        np.multiply(found[:, order - 1], x, out=found[:, order])
    return found


def constants(theta: FloatArray, temps_degc: FloatArray, t0_degc: float) -> FloatArray:
    """U0 and K at temperatures, shape (n, 3, 4): column 0 is U0."""
    curves = theta.reshape(12, ORDERS)
    return np.asarray((powers(temps_degc, t0_degc) @ curves.T).reshape(-1, 3, 4))


def seen_force(readings: Readings, theta: FloatArray) -> FloatArray:
    """Force that the unit sees with these constants, shape (n, 3), g."""
    return _force(constants(theta, readings.temps_degc, readings.t0_degc), readings.outputs)


def _force(at: FloatArray, outputs: FloatArray) -> FloatArray:
    free = (outputs - at[:, :, 0])[:, :, None]
    return np.asarray(np.linalg.solve(at[:, :, 1:], free)[:, :, 0])


def residuals(readings: Readings, theta: FloatArray, at: FloatArray | None = None) -> FloatArray:
    """Of every row: output less model in test positions, |a| - g in check positions, g.

    `at` are the `constants` at the temperatures of the readings, where they are known.
    """
    test = readings.test
    if at is None:
        at = constants(theta, readings.temps_degc, readings.t0_degc)
    model = at[:, :, 0] + np.einsum("nij,nj->ni", at[:, :, 1:], readings.force)
    own = (readings.outputs - model)[test].ravel()
    if test.all():
        return np.asarray(own)
    seen = np.linalg.norm(_force(at[~test], readings.outputs[~test]), axis=1) - 1.0
    return np.concatenate([own, seen])


class BendFeatures:
    """Functions of temperature with the covariance exp(-(dT / length)^2 / 2) at given ones."""

    def __init__(self, temps_degc: FloatArray, length_degc: float = _BEND_DEGC) -> None:
        self.temps = np.unique(np.round(temps_degc, 1))
        self.length = length_degc
        values, vectors = np.linalg.eigh(self._kernel(self.temps))
        keep = values > 1e-3
        self._map = vectors[:, keep] / np.sqrt(values[keep])
        self.count = int(keep.sum())

    def _kernel(self, temps_degc: FloatArray) -> FloatArray:
        return np.asarray(np.exp(-0.5 * ((temps_degc[:, None] - self.temps) / self.length) ** 2))

    def at(self, temps_degc: FloatArray) -> FloatArray:
        """Shape (n, count)."""
        return np.asarray(self._kernel(temps_degc) @ self._map)


def standing_force(readings: Readings, theta: FloatArray) -> Readings:
    """The readings, with the force in check positions as the unit sees it."""
    if readings.test.all():
        return readings
    try:
        seen = seen_force(readings, theta)
    except np.linalg.LinAlgError:
        seen = readings.outputs
    return readings.but(force=np.where(readings.test[:, None], readings.force, seen))
