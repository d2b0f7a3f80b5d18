"""What readings of a pair on a dividing head must look like before P3's coefficients mean anything.

Source: P3 (3), (5): A swings as -g cos(theta), B as g sin(theta), but for small coefficients.
"""

from __future__ import annotations

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.outliers import left_out_residuals, worst_outlier
from triaxcal.model.types import FloatArray

SIZE_MAX = 1.5
"""A sensitivity further from 1 than by this factor is another unit, no scale error."""
TURNED_MAX_DEG = 15.0
"""P3 is of first order in the coefficients and the head's zero: beyond are other axes or signs."""
_FAR_G = 0.3
"""Turned by 15 deg, or another sensitivity: beyond it is another position, sign or unit."""
_UNITS = {9.80665: "m/s^2", 1000.0: "mg"}


def refuse_other_readings(
    source: str, theta_rad: FloatArray, a_g: FloatArray, b_g: FloatArray, gravity_g: float
) -> None:
    """Refuse readings in another unit, of other axes, or from another zero of the head.

    Raises
    ------
    RefusedError
        Naming the column and what it swings as.
    """
    s, c = np.sin(theta_rad), np.cos(theta_rad)
    design = np.stack([np.ones_like(s), s, c], axis=-1)
    for name, reading, nominal in (("a_g", a_g, (0.0, -1.0)), ("b_g", b_g, (1.0, 0.0))):
        swing = np.linalg.lstsq(design, reading / gravity_g, rcond=None)[0][1:]
        size = float(np.hypot(*swing))
        if not 1 / SIZE_MAX < size < SIZE_MAX:
            unit = next((u for k, u in _UNITS.items() if abs(np.log(size / k)) < 0.2), "")
            raise RefusedError(
                f"{source}, column {name}",
                f"the readings swing by {size:.4g} g over a turn" + (f" ({unit}?)" if unit else ""),
                expected="about 1 g",
                remedy="give them in g",
            )
        turned = np.degrees(np.arctan2(swing[1], swing[0]) - np.arctan2(nominal[1], nominal[0]))
        turned = (turned + 180.0) % 360.0 - 180.0
        if abs(turned) > TURNED_MAX_DEG:
            expected = "-cos(theta)" if name == "a_g" else "sin(theta)"
            raise RefusedError(
                f"{source}, column {name}",
                f"the readings swing as {expected} turned by {turned:+.0f} deg",
                expected=f"{expected}, within {TURNED_MAX_DEG:g} deg",
                remedy="check the order of the columns, their signs, and the head's zero: "
                "at theta = 0 A reads -1 g, at 90 deg B reads +1 g",
            )


def doubtful_position(residual: FloatArray, H: FloatArray, root: FloatArray) -> str:
    """The position that the others contradict, in words; "" if there is none.

    `residual` and `H` are over `root`, the standard deviations of Z; 1 where they are unknown.
    """
    left_out = left_out_residuals(residual, H)
    found = worst_outlier(residual[:, None], left_out[:, None], H.shape[1])
    if found is None:
        return ""
    k = found.indices[0]
    return (
        f"position {k + 1} differs by {abs(float(left_out[k] * root[k])):.2g} g^2 in Z from the "
        f"fit of the others, whose residuals are {found.others * float(root.mean()):.2g} rms: "
        "check its row"
    )


def odd_reading(theta_rad: float, a_g: float, b_g: float, gravity_g: float) -> str:
    """What is wrong with one position's readings, in words; "" where nothing is."""
    expected = gravity_g * np.array([-np.cos(theta_rad), np.sin(theta_rad)])
    for name, found, right in zip("AB", (a_g, b_g), expected, strict=True):
        if not np.isfinite(found) or abs(found - right) > _FAR_G:
            return (
                f"{name} reads {found:.4g} at {np.degrees(theta_rad):.5g} deg; expected about "
                f"{right:.3f} g (at 0 deg A reads -1 g, at 90 deg B reads +1 g)"
            )
    return ""
