"""Errors of (6) and (8) of P0 over an angle, and how sensitive they are to errors of the triad.

    S_i = dS_i + (1 + dK_i) g_i + sum_j e_ij g_j                                            (4)

The error of (6) is that of a component, dS_i + dK_i g_i + sum e_ij g_j. That of (8) is the angle
computed from S less the angle that was set; its sensitivities are the derivatives of (8),

    d/dS_i = D_i,    d/dK_i = D_i g_i,    d/de_ij = D_i g_j,    D = d(8)/dg.

Hysteresis near the threshold: an output follows the force only when it has moved by the width h, so
it reads g - h on the way up and g + h on the way down. A turn in one direction cannot tell: there
the square wave -h sign(dg) is a turn of the axis by 4 h / pi, and a third harmonic of a third of
that. The same angles approached from both sides show h as half of the difference.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.model.orientation import (
    angle_slopes,
    angle_slopes_of_force,
    angles_from_force,
    gravity_direction,
)
from triaxcal.model.types import FloatArray


@dataclass(frozen=True)
class AngleErrors:
    """Errors over a swept angle; n angles.

    Attributes
    ----------
    angles_deg : array, shape (n, 2)
    force_error_g : array, shape (n, 3)
        Of (6).
    angle_error_arcsec : array, shape (n, 2)
        Of (8); NaN where the second angle does not exist.
    per_offset : array, shape (n, 2, 3)
        Arcseconds for 1 mg of dS.
    per_scale : array, shape (n, 2, 3)
        Arcseconds for dK = 1e-3.
    per_misalignment : array, shape (n, 2, 3, 3)
        Arcseconds for 1 arcsecond of e_ij.
    """

    angles_deg: FloatArray
    force_error_g: FloatArray
    angle_error_arcsec: FloatArray
    per_offset: FloatArray
    per_scale: FloatArray
    per_misalignment: FloatArray


def angle_errors(
    kind: str,
    angles_rad: FloatArray,
    offset_g: FloatArray,
    scale: FloatArray,
    misalignment_rad: FloatArray,
) -> AngleErrors:
    """Errors and sensitivities at angles (n, 2), for dS (3,), dK (3,) and e (3, 3), zero diagonal.

    The errors are exact, the sensitivities those of first order. |g| is 1 g.
    """
    force = gravity_direction(kind, angles_rad)
    read = offset_g + force + force * scale + force @ misalignment_rad.T
    away = angles_from_force(kind, read) - angles_rad[:, :2]
    arcsec = np.degrees((away + np.pi) % (2.0 * np.pi) - np.pi) * 3600.0
    D = angle_slopes_of_force(kind, force)
    arcsec[np.isnan(D[:, 0, 0])] = np.nan
    per_mg = np.degrees(D) * 3600.0 * 1e-3
    return AngleErrors(
        angles_deg=np.degrees(angles_rad[:, :2]),
        force_error_g=read - force,
        angle_error_arcsec=arcsec,
        per_offset=per_mg,
        per_scale=per_mg * force[:, None],
        per_misalignment=D[:, :, :, None] * force[:, None, None, :],
    )


@dataclass(frozen=True)
class Hysteresis:
    """Width of the hysteresis of each output, from angles approached from both sides.

    Attributes
    ----------
    width, sd : arrays, shape (3,)
        h, in the readings' unit; an output moves when the force has moved by 2 h.
    """

    width: FloatArray
    sd: FloatArray

    @property
    def seen(self) -> tuple[bool, ...]:
        """Whether each is more than 3 standard deviations."""
        return tuple(bool(w > 3.0 * s) for w, s in zip(self.width, self.sd, strict=True))


def hysteresis(
    kind: str, angles_rad: FloatArray, swept: int, rising: FloatArray, falling: FloatArray
) -> Hysteresis:
    """Hysteresis from readings (n, 3) at the same angles, reached from below and from above.

    `swept` is the angle that was turned, 0 or 1. Where a force hardly changes with it the output
    says nothing: such angles are left out.
    """
    slope = angle_slopes(kind, angles_rad)[:, :, swept]
    half = -(rising - falling) / 2.0 * np.sign(slope)
    used = np.abs(slope) > 0.1
    width, sd = np.full(3, np.nan), np.full(3, np.nan)
    for i in range(3):
        values = half[used[:, i], i]
        if len(values) > 1:
            width[i], sd[i] = values.mean(), values.std(ddof=1) / np.sqrt(len(values))
    return Hysteresis(width, sd)
