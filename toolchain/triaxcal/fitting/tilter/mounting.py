"""How the sensing axes lie in the case, and how long they are beside one another.

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
_UNEQUAL = 1.5
"""Outputs of one type differ by a few percent, and full scales by factors of 2."""
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


def unequal_notes(constants: FloatArray) -> tuple[str, ...]:
    """One output far more or less sensitive than the two others, for constants (12,) at T0."""
    odd = unequal_output(constants)
    if odd is None:
        return ()
    text = f"output {odd[0]} is {odd[1]:.3g} times as sensitive as the other outputs"
    return (f"{text}: its full scale or gain may be another one than in use",)


def unequal_output(constants: FloatArray) -> tuple[str, float] | None:
    """The output whose sensitivity is not that of the two others, and their ratio."""
    length = np.linalg.norm(unpack_constants(constants)[0], axis=1)
    for i, axis in enumerate(AXES):
        others = np.delete(length, i)
        ratio = float(length[i] / np.sqrt(np.prod(others)))
        if others.max() < _UNEQUAL * others.min() and not 1.0 / _UNEQUAL < ratio < _UNEQUAL:
            return axis, ratio
    return None
