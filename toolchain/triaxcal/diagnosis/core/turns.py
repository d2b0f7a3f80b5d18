"""Rotations, and the position that another one becomes by a rotation."""

from __future__ import annotations

import numpy as np

from triaxcal.diagnosis.core.readings import Readings
from triaxcal.model.types import FloatArray


def rotation(angle_rad: FloatArray) -> FloatArray:
    """Rotation matrix of a rotation vector, Rodrigues."""
    size = float(np.linalg.norm(angle_rad))
    if size == 0.0:
        return np.eye(3)
    x, y, z = angle_rad / size
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(size) * cross + (1.0 - np.cos(size)) * cross @ cross)


def sensitivity(readings: Readings) -> FloatArray:
    """K of the six positions, all temperatures together, shape (3, 3); rows are outputs."""
    test = readings.test
    one = np.column_stack([np.ones(int(test.sum())), readings.force[test]])
    found = np.linalg.lstsq(one, readings.outputs[test], rcond=None)[0]
    return np.asarray(found[1:].T)


def nearest_rotation(K: FloatArray) -> FloatArray | None:
    """Rotation, or reflection, whose rows are nearest those of K; None where K is singular."""
    length = np.linalg.norm(K, axis=1)
    if (length < 0.2).any():
        return None
    U, values, Vt = np.linalg.svd(K / length[:, None])
    return np.asarray(U @ Vt) if values[-1] > 0.3 else None


def angle_and_axis(turn: FloatArray) -> tuple[float, FloatArray]:
    """Angle of a rotation in degrees, and its axis, shape (3,)."""
    angle = float(np.degrees(np.arccos(np.clip((np.trace(turn) - 1.0) / 2.0, -1.0, 1.0))))
    values, vectors = np.linalg.eig(turn)
    axis = np.real(vectors[:, int(np.abs(values - 1.0).argmin())])
    twist = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    sign = float(axis @ twist)
    return angle, np.asarray(axis if sign >= 0.0 else -axis)
