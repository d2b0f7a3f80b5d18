"""How far the sensor is turned against the case, from the directions of its sensing axes.

The rows of K, divided by their lengths and by the signs that they should have, are the directions
of the three sensing axes in the case. The nearest rotation (polar decomposition) is the mounting.
A turned sensor is no fault: K takes it off. It is said, because nobody may have meant it.
"""

from __future__ import annotations

import math

import numpy as np

from triaxcal.model.metrological import unpack_constants
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray

_WORTH_SAYING_DEG = 5.0
"""Sensors on a board are within one or two degrees of it."""
_ANSWERS = 0.1
_ALONG = math.cos(math.radians(5.0))


def turned_notes(constants: FloatArray) -> tuple[str, ...]:
    """The angle of a turned sensor, for constants (12,) at T0; nothing for a straight one."""
    K, _ = unpack_constants(constants)
    length = np.linalg.norm(K, axis=1)
    own = np.diag(K) / length
    # The sign of an output that does not answer along its own axis is unknown; it is then that of
    # the others, or +.
    sign = -1.0 if own.sum() < -_ANSWERS else 1.0
    signs = np.where(np.abs(own) > _ANSWERS, np.sign(own), sign)
    rows = K / (length * signs)[:, None]
    left, _, right = np.linalg.svd(rows)
    mounting = left @ right
    cosine = (float(np.trace(mounting)) - 1.0) / 2.0
    angle = math.degrees(math.acos(min(1.0, max(-1.0, cosine))))
    if np.linalg.det(mounting) < 0.0 or angle < _WORTH_SAYING_DEG:
        return ()
    skew = mounting - mounting.T
    axis = np.array([skew[1, 2], skew[2, 0], skew[0, 1]])
    axis /= np.linalg.norm(axis) or 1.0
    main = int(np.abs(axis).argmax())
    about = "(" + ", ".join(f"{a:+.2f}" for a in axis) + ")"
    if abs(axis[main]) > _ALONG:
        about = ("-" if axis[main] < 0.0 else "") + AXES[main]
    words = f"the sensor is turned by {angle:.1f} deg about {about} of the case; K takes it off, "
    return (words + "and the outputs of the C are along the case",)
