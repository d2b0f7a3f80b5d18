"""The frame of a calibration that only knows |a|: a rotation of a that no pose can show.

"sensor" leaves K symmetric: no frame turns the outputs' own axes less. "case" turns a so that poses
near an axis, the unit lying on its faces, point along it as well as they can together (Kabsch).
"""

from __future__ import annotations

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.terms import PRODUCT_AXES
from triaxcal.model.types import FloatArray, IntArray

SENSOR, CASE = "sensor", "case"
FACE_DEG = 10.0
"""A pose nearer than this to an axis lies on a face."""


def faces_of(force: FloatArray) -> tuple[IntArray, FloatArray]:
    """Indices of the poses on a face, shape (m,), and the faces' directions, shape (m, 3)."""
    unit = force / np.linalg.norm(force, axis=1, keepdims=True)
    axis = np.abs(unit).argmax(axis=1)
    index: IntArray = np.flatnonzero(
        np.abs(unit[np.arange(len(unit)), axis]) >= np.cos(np.radians(FACE_DEG))
    )
    target = np.zeros((len(index), 3))
    target[np.arange(len(index)), axis[index]] = np.sign(unit[index, axis[index]])
    return index, target


def rotation_to(force: FloatArray, target: FloatArray) -> FloatArray:
    """Rotation R, (3, 3), that brings forces (n, 3) nearest to targets: R a, least squares."""
    u, _, vt = np.linalg.svd(target.T @ force)
    sign = np.sign(np.linalg.det(u @ vt))
    rotation: FloatArray = u @ np.diag([1.0, 1.0, sign]) @ vt
    return rotation


def case_rotation(source: str, force: FloatArray) -> tuple[FloatArray, str]:
    """Rotation to the case, and what it rests on in words.

    Raises
    ------
    RefusedError
        When fewer than two axes have poses on a face.
    """
    index, target = faces_of(force)
    axes = int((np.abs(target).sum(axis=0) > 0).sum()) if len(index) else 0
    if axes < 2:
        raise RefusedError(
            source,
            f"poses on the faces of {axes} ax{'i' if axes == 1 else 'e'}s",
            expected='two axes at least for frame = "case"',
            remedy='lay the unit on its faces, or choose frame = "sensor"',
        )
    rotation = rotation_to(force[index], target)
    turned = force[index] @ rotation.T
    length = np.linalg.norm(turned, axis=1)
    cosine = np.clip((turned * target).sum(axis=1) / length, -1.0, 1.0)
    angle = float(np.degrees(np.arccos((np.trace(rotation) - 1.0) / 2.0)))
    scatter = float(np.degrees(np.sqrt(np.mean(np.arccos(cosine) ** 2))))
    return rotation, (
        f"frame of the case from {len(index)} poses on its faces, {angle:.2f} deg from the "
        f"sensor's own; the faces agree within {scatter:.2f} deg rms"
    )


def turned_constants(constants: FloatArray, rotation: FloatArray) -> FloatArray:
    """Constants (12, P) for forces R a instead of a: K R^T, the same biases."""
    K = constants[:9].T.reshape(-1, 3, 3) @ rotation.T
    return np.concatenate([K.reshape(-1, 9).T, constants[9:]])


def turned_quadratic(quadratic: FloatArray, rotation: FloatArray) -> FloatArray:
    """Q (3, 6) for forces R a: R Q M, where the products of R^T a are M products(a)."""
    turn = np.zeros((6, 6))
    for k, (i, j) in enumerate(PRODUCT_AXES):
        outer = np.outer(rotation.T[i], rotation.T[j])
        for m, (p, q) in enumerate(PRODUCT_AXES):
            turn[k, m] = outer[p, q] if p == q else outer[p, q] + outer[q, p]
    result: FloatArray = rotation @ quadratic @ turn
    return result
