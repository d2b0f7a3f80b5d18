"""Angles of the device in Python's integers, for the firmware of a unit and of an IMU."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from triaxcal.base.arrays import int32
from triaxcal.base.errors import RefusedError
from triaxcal.codegen.routines import UInt32Array
from triaxcal.fixedpoint.angles import AnglesPlan, angles

Angles = tuple[npt.NDArray[np.integer[Any]], UInt32Array]
"""Binary angles, shape (n, 2), and status, shape (n,)."""


def asked_for(plan: AnglesPlan | None, unit: str, table: str) -> AnglesPlan:
    """The plan of the angles; `table` is where unit.toml states them.

    Raises
    ------
    RefusedError
        Where there is none.
    """
    if plan is None:
        raise RefusedError(
            "angles",
            f"unit {unit} states none",
            expected=f'[{table}] angles = "zenith-tool-face" or "pitch-roll"',
            remedy="state it in unit.toml",
        )
    return plan


def angles_of(plan: AnglesPlan, accel: Any) -> Angles:
    """Answers of `triax_angles` for accelerations of shape (n, 3).

    Raises
    ------
    RefusedError
        For another shape, or a number beyond int32.
    """
    angle, status = angles(plan, int32("accel", accel, 3).astype(np.int64))
    return angle.astype(np.uint32 if plan.zenith else np.int32), status.astype(np.uint32)
