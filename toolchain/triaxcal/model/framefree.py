"""The nine constants of a triad that no rotation of the frame changes.

Output i is U_i = k_i . a + U0_i. Its sensitivity is |k_i|, its bias U0_i / |k_i| in g, and two
outputs' sensing axes stand at the angle of k_i and k_j. K R with a rotation R has the same nine:
what turns the frame, as another mounting or another convention does, is in none of them.
"""

from __future__ import annotations

import numpy as np

from triaxcal.model.metrological import unpack_constants
from triaxcal.model.types import FloatArray

NAMES = ("sensitivity x", "sensitivity y", "sensitivity z", "angle xy", "angle xz", "angle yz",
         "bias x", "bias y", "bias z")  # fmt: skip
"""Order of every array with a last axis of 9."""
_PAIRS = ((0, 1), (0, 2), (1, 2))
_STEP = 1e-6


def frame_free(constants: FloatArray) -> FloatArray:
    """Nine constants, shape (..., 9), of twelve: reading unit/g, rad from a right angle, g."""
    K, U0 = unpack_constants(constants)
    length = np.linalg.norm(K, axis=-1)
    axes = K / length[..., None]
    cosines = [np.sum(axes[..., i, :] * axes[..., j, :], axis=-1) for i, j in _PAIRS]
    beyond = -np.arcsin(np.clip(np.stack(cosines, axis=-1), -1.0, 1.0))
    return np.concatenate([length, beyond, U0 / length], axis=-1)


def frame_free_slopes(constants: FloatArray) -> FloatArray:
    """Derivative of the nine by the twelve constants (12,), shape (9, 12)."""
    step = _STEP * float(np.abs(constants[:9]).max())
    steps = step * np.eye(12)
    change = frame_free(constants + steps) - frame_free(constants - steps)
    result: FloatArray = change.T / (2.0 * step)
    return result


def relative_scales(constants: FloatArray) -> FloatArray:
    """What brings a change of the nine to ppm, micro-rad and mg, shape (9,)."""
    sensitivity = frame_free(constants)[:3]
    return np.concatenate([1e6 / sensitivity, np.full(3, 1e6), np.full(3, 1e3)])


UNITS = ("ppm",) * 3 + ("urad",) * 3 + ("mg",) * 3
