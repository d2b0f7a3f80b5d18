"""Specific force from angles and angles from specific force, P0 (2), (3), (6), (8).

Both conventions turn the unit from the geographic frame, Z along the plumb line, and give the
third column of the matrix of direction cosines, g_i / g = a_i3.

aircraft      yaw psi about Z, pitch mu about Y_2, roll nu about X, as the three printed rotations
              say: X = X_2 cos mu - Z sin mu, Z_2 = X_2 sin mu + Z cos mu, Y = Y_2 cos nu + Z_2 sin
              nu, Z = -Y_2 sin nu + Z_2 cos nu. So a13 = -sin mu, a23 = cos mu sin nu, a33 = cos mu
              cos nu. In print (3) has a13 = +sin mu and a wrong sign in a32, and is not orthogonal.
inclinometer  azimuth alpha about Z, zenith theta about Y_2, tool face phi about Z: a13 = -sin theta
              cos phi, a23 = -sin theta sin phi, a33 = cos theta.

Here a positive a_i means that axis i reads +1 g when it points along +Z; which way Z points (up for
an accelerometer that reads +1 g upwards) is the reading's own convention, and one for all axes.
"""

from __future__ import annotations

import numpy as np

from triaxcal.model.types import FloatArray

AIRCRAFT, INCLINOMETER = "aircraft", "inclinometer"
_HORIZON_MIN = 1e-6
"""Of the second angle's circle, g: below it (8) has no second angle."""


def direction_cosines(kind: str, angles_rad: FloatArray) -> FloatArray:
    """Matrix a_ij of P0 (1), shape (..., 3, 3): rows are the unit's axes, columns the world's.

    Parameters
    ----------
    kind : str
        "aircraft": angles pitch, roll, yaw. "inclinometer": zenith, tool face, azimuth.
    angles_rad : array, shape (..., 2 or 3)
        The third is taken as zero where it is missing; gravity does not depend on it.
    """
    first, second = angles_rad[..., 0], angles_rad[..., 1]
    third = angles_rad[..., 2] if angles_rad.shape[-1] == 3 else np.zeros_like(first)
    heading = _about_z(third)
    about_y = _about_y(first)
    last = _about_x(second) if kind == AIRCRAFT else _tool_face(second)
    result: FloatArray = last @ about_y @ heading
    return result


def gravity_direction(kind: str, angles_rad: FloatArray) -> FloatArray:
    """g / |g| on the unit's axes, P0 (6), shape (..., 3)."""
    first, second = angles_rad[..., 0], angles_rad[..., 1]
    if kind == AIRCRAFT:
        parts = (-np.sin(first), np.cos(first) * np.sin(second), np.cos(first) * np.cos(second))
    else:
        parts = (
            -np.sin(first) * np.cos(second),
            -np.sin(first) * np.sin(second),
            np.cos(first),
        )
    return np.stack(parts, axis=-1)


def angles_from_force(kind: str, force: FloatArray) -> FloatArray:
    """The two angles that gravity shows, P0 (8) with atan2 and the signs of (6), shape (..., 2).

    Pitch within +-90 deg and roll within +-180 deg; zenith within 0 to 180 deg, tool face within
    +-180 deg. Roll is meaningless at a pitch of +-90 deg, tool face at a zenith of 0.
    """
    x, y, z = force[..., 0], force[..., 1], force[..., 2]
    if kind == AIRCRAFT:
        return np.stack([np.arctan2(-x, np.hypot(y, z)), np.arctan2(y, z)], axis=-1)
    return np.stack([np.arctan2(np.hypot(x, y), z), np.arctan2(-y, -x)], axis=-1)


def angle_slopes(kind: str, angles_rad: FloatArray) -> FloatArray:
    """Derivatives of `gravity_direction` by the two angles, shape (..., 3, 2), per radian."""
    first, second = angles_rad[..., 0], angles_rad[..., 1]
    s1, c1, s2, c2 = np.sin(first), np.cos(first), np.sin(second), np.cos(second)
    zero = np.zeros_like(first)
    if kind == AIRCRAFT:
        rows = ((-c1, zero), (-s1 * s2, c1 * c2), (-s1 * c2, -c1 * s2))
    else:
        rows = ((-c1 * c2, s1 * s2), (-c1 * s2, -s1 * c2), (-s1, zero))
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def angle_slopes_of_force(kind: str, force: FloatArray) -> FloatArray:
    """D of (8): derivatives of the two angles by the force (n, 3), shape (n, 2, 3), rad/g."""
    x, y, z = force[:, 0], force[:, 1], force[:, 2]
    total = (force**2).sum(axis=1)
    result = np.full((len(force), 2, 3), np.nan)
    if kind == AIRCRAFT:
        circle = np.hypot(y, z)
        with np.errstate(divide="ignore", invalid="ignore"):
            first = (-circle / total, x * y / (circle * total), x * z / (circle * total))
            second = (np.zeros_like(x), z / circle**2, -y / circle**2)
    else:
        circle = np.hypot(x, y)
        with np.errstate(divide="ignore", invalid="ignore"):
            first = (x * z / (circle * total), y * z / (circle * total), -circle / total)
            second = (-y / circle**2, x / circle**2, np.zeros_like(x))
    seen = circle > _HORIZON_MIN
    result[seen, 0] = np.stack(first, axis=1)[seen]
    result[seen, 1] = np.stack(second, axis=1)[seen]
    return result


def _matrix(rows: tuple[tuple[FloatArray, ...], ...]) -> FloatArray:
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _about_z(angle: FloatArray) -> FloatArray:
    s, c, o = np.sin(angle), np.cos(angle), np.zeros_like(angle)
    return _matrix(((c, s, o), (-s, c, o), (o, o, o + 1.0)))


def _about_y(angle: FloatArray) -> FloatArray:
    s, c, o = np.sin(angle), np.cos(angle), np.zeros_like(angle)
    return _matrix(((c, o, -s), (o, o + 1.0, o), (s, o, c)))


def _about_x(angle: FloatArray) -> FloatArray:
    s, c, o = np.sin(angle), np.cos(angle), np.zeros_like(angle)
    return _matrix(((o + 1.0, o, o), (o, c, s), (o, -s, c)))


def _tool_face(angle: FloatArray) -> FloatArray:
    # Clockwise in P0: X = X_3 cos phi - Y_2 sin phi, Y = X_3 sin phi + Y_2 cos phi.
    s, c, o = np.sin(angle), np.cos(angle), np.zeros_like(angle)
    return _matrix(((c, -s, o), (s, c, o), (o, o, o + 1.0)))
