"""|a| at readings of a calibration, and its derivatives."""

from __future__ import annotations

import numpy as np

from triaxcal.fitting.core.calibration import Calibration
from triaxcal.model.metrological import force_from_voltage, unpack_constants
from triaxcal.model.terms import product_slopes
from triaxcal.model.types import FloatArray


def force_and_slopes(
    calibration: Calibration, readings: FloatArray, temps_degc: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Force (n, 3) in g, and derivative of its length by the reading (n, 3)."""
    constants = calibration.thermal.constants_at(temps_degc)
    linear = force_from_voltage(constants, readings)
    force = calibration.terms.force_g(linear)
    N = np.linalg.inv(unpack_constants(constants)[0])
    slopes: FloatArray = np.einsum(
        "ni,nij->nj", length_slopes(calibration.terms.quadratic_per_g, linear, force), N
    )
    return force, slopes


def length_slopes(Q: FloatArray | None, linear: FloatArray, force: FloatArray) -> FloatArray:
    """Derivative of |a| by the linear result N (U - U0), shape (n, 3)."""
    unit: FloatArray = force / np.linalg.norm(force, axis=1, keepdims=True)
    if Q is None:
        return unit
    more: FloatArray = np.einsum("ni,ik,nkj->nj", unit, Q, product_slopes(linear))
    return unit + more
