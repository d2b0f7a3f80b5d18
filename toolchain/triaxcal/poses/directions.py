"""How the poses of a recording lie, where it says so: angles, or unit vectors as angles."""

from __future__ import annotations

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.orientation import AIRCRAFT, angles_from_force
from triaxcal.model.types import FloatArray
from triaxcal.readings.samples import ANGLES, Samples
from triaxcal.unit.recording import RecordingLayout

_UNIT = 0.01
"""Of 1: unit vectors with two decimals are no longer or shorter."""


def pose_angles(samples: Samples, layout: RecordingLayout, start: int, stop: int) -> FloatArray:
    """Angles of samples, shape (n, 2 or 3), rad, in the order of `ANGLE_NAMES`.

    Raises
    ------
    RefusedError
        For a direction that is no unit vector.
    """
    found = samples.part(ANGLES, start, stop)
    if layout.direction is None:
        return found
    length = np.linalg.norm(found, axis=1)
    wrong = np.abs(length - 1.0) > _UNIT
    if wrong.any():
        first = int(np.argmax(wrong))
        raise RefusedError(
            samples.place(start + first),
            f"a direction {length[first]:.4g} long",
            expected="unit vectors in the columns of direction",
            remedy="divide each by its length, or correct the columns",
        )
    return angles_from_force(AIRCRAFT, found)
