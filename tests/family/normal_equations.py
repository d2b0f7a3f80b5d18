"""The normal equations as P0 prints them: (15), (17), (20)-(21), (25)-(26).

Documented and tested as equivalents of `oriented`; nothing else uses them. They square the
condition number of the design, which is what (17) and (20) are there to soften.
"""

from __future__ import annotations

import numpy as np

from triaxcal.model.terms import products
from triaxcal.model.types import FloatArray


def plain(readings: FloatArray, force: FloatArray) -> FloatArray:
    """(15), (16): c_0i, c_1i, c_2i, c_3i of each axis i, shape (3, 4)."""
    design = _design(readings)
    result: FloatArray = np.linalg.solve(design.T @ design, design.T @ force).T.astype(np.float64)
    return result


def from_identity(readings: FloatArray, force: FloatArray) -> FloatArray:
    """(17): solve for c_0i and the deviation of C from one, shape (3, 4), readings in g."""
    design = _design(readings)
    deviation = np.linalg.solve(design.T @ design, design.T @ (force - readings)).T
    result: FloatArray = deviation + np.eye(3, 4, 1)
    return result


def centred(readings: FloatArray, force: FloatArray) -> FloatArray:
    """(18)-(21): means taken off first, so that three unknowns an axis are left, shape (3, 4)."""
    u, g = readings - readings.mean(axis=0), force - force.mean(axis=0)
    C = np.linalg.solve(u.T @ u, u.T @ g).T
    offset = force.mean(axis=0) - C @ readings.mean(axis=0)
    result: FloatArray = np.concatenate([offset[:, None], C], axis=1)
    return result


def two_stages(readings: FloatArray, force: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(25), (26): linear first, then six unknowns on its residuals; shapes (3, 4) and (3, 6).

    The products are those of the readings, as printed, in the order of `model.terms`.
    """
    linear = plain(readings, force)
    residual = force - _design(readings) @ linear.T
    p = products(readings)
    quadratic = np.linalg.lstsq(p.T @ p, p.T @ residual, rcond=None)[0].T
    return linear, quadratic.astype(np.float64)


def _design(readings: FloatArray) -> FloatArray:
    return np.concatenate([np.ones((len(readings), 1)), readings], axis=1)
