"""Rotations, and the position that another one becomes by a rotation."""

from __future__ import annotations

import numpy as np

from triaxcal.model.types import FloatArray


def rotation(angle_rad: FloatArray) -> FloatArray:
    """Rotation matrix of a rotation vector, Rodrigues."""
    size = float(np.linalg.norm(angle_rad))
    if size == 0.0:
        return np.eye(3)
    x, y, z = angle_rad / size
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(size) * cross + (1.0 - np.cos(size)) * cross @ cross)
