"""Rotations, many at a time. Quaternions are (w, x, y, z), instrument axes to the outer frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from triaxcal.model.types import FloatArray

ComplexArray = NDArray[np.complex128]


def skew(x: FloatArray) -> FloatArray:
    """[x] with [x] y = x cross y, shape (..., 3, 3); P2's hat(x) is -[x]."""
    result = np.zeros((*x.shape[:-1], 3, 3))
    result[..., 0, 1], result[..., 1, 0] = -x[..., 2], x[..., 2]
    result[..., 0, 2], result[..., 2, 0] = x[..., 1], -x[..., 1]
    result[..., 1, 2], result[..., 2, 1] = -x[..., 0], x[..., 0]
    return result


def quaternion_of(rotation_vector: FloatArray) -> FloatArray:
    """Quaternions (..., 4) of rotation vectors (..., 3), rad."""
    half = 0.5 * np.sqrt(np.einsum("...i,...i", rotation_vector, rotation_vector))
    # sinc keeps full precision at zero
    vector = rotation_vector * (0.5 * np.sinc(half / np.pi))[..., None]
    return np.concatenate([np.cos(half)[..., None], vector], axis=-1)


def quaternion_product(a: FloatArray, b: FloatArray) -> FloatArray:
    """a b, shape (..., 4)."""
    aw, ax, ay, az = (a[..., k] for k in range(4))
    bw, bx, by, bz = (b[..., k] for k in range(4))
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=-1,
    )


def matrix_of(quaternion: FloatArray) -> FloatArray:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    w, x, y, z = np.moveaxis(quaternion, -1, 0)
    result = np.empty((*quaternion.shape[:-1], 3, 3))
    result[..., 0, 0] = 1 - 2 * (y * y + z * z)
    result[..., 1, 1] = 1 - 2 * (x * x + z * z)
    result[..., 2, 2] = 1 - 2 * (x * x + y * y)
    result[..., 0, 1], result[..., 1, 0] = 2 * (x * y - w * z), 2 * (x * y + w * z)
    result[..., 0, 2], result[..., 2, 0] = 2 * (x * z + w * y), 2 * (x * z - w * y)
    result[..., 1, 2], result[..., 2, 1] = 2 * (y * z - w * x), 2 * (y * z + w * x)
    return result


def rotation_of(rotation_vector: FloatArray) -> FloatArray:
    """exp([v]), shape (..., 3, 3), of rotation vectors (..., 3), rad."""
    return matrix_of(quaternion_of(rotation_vector))


def running_product(steps: FloatArray) -> FloatArray:
    """q_1 ... q_k for every k, of unit quaternions of shape (n, 4).

    Blocks of about sqrt(n) run side by side; then their ends are chained. A quaternion is a pair
    of complex numbers, q = u + v j with u = w + x i and v = y + z i, so that

        (u, v) (u', v') = (u u' - v v'*, u v' + v u'*).
    """
    n = len(steps)
    side = max(1, round(n**0.5))
    blocks = -(-n // side)
    padded = np.zeros((blocks * side, 4))
    padded[:, 0] = 1.0
    padded[:n] = steps
    pairs = padded.view(np.complex128).reshape(blocks, side, 2)
    u, v = (np.ascontiguousarray(pairs[:, :, k].T) for k in (0, 1))
    for j in range(1, side):
        u[j], v[j] = _pair_product(u[j - 1], v[j - 1], u[j], v[j])
    u, v = np.ascontiguousarray(u.T), np.ascontiguousarray(v.T)
    for b in range(1, blocks):
        u[b], v[b] = _pair_product(u[b - 1, -1], v[b - 1, -1], u[b], v[b])
    pairs[:, :, 0], pairs[:, :, 1] = u, v
    result = padded[:n]
    result /= np.sqrt(np.einsum("ij,ij->i", result, result))[:, None]
    return result


def _pair_product(
    u: ComplexArray, v: ComplexArray, u2: ComplexArray, v2: ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    return u * u2 - v * v2.conj(), u * v2 + v * u2.conj()


def level(force: FloatArray, heading_rad: float) -> FloatArray:
    """Rotation (3, 3) from instrument axes to a level frame at rest, by the force (3,), upwards.

    With heading zero the frame's first axis is the horizontal part of the instrument axis that is
    nearest to level; the heading turns the frame about up.
    """
    up = force / np.linalg.norm(force)
    first = np.eye(3)[int(np.argmin(np.abs(up)))]
    east = first - up * (first @ up)
    east /= np.linalg.norm(east)
    levelled = np.array([east, np.cross(up, east), up])
    turned: FloatArray = rotation_of(np.array([0.0, 0.0, heading_rad])) @ levelled
    return turned
