"""Whether the table's angles turn as the gyros do: the same way, about the axis that is stated."""

from __future__ import annotations

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.dynamic.stages import Stage
from triaxcal.dynamic.windows import Windows
from triaxcal.model.types import FloatArray

ALIKE = 0.2
"""Gyros and angle agree to a coarse unit's scale factors."""
LEAST_RAD = 1.0
"""Turned in all, by the angle."""


def refuse_other_angles(
    recording: ImuRecording, windows: Windows, stages: tuple[Stage, ...], bias: FloatArray
) -> None:
    """Refuse angles of a table that turn otherwise than the unit on it.

    `bias`, shape (w, 3), is that of the gyros.

    Raises
    ------
    RefusedError
    """
    table = recording.table
    if table is None or not table.mountings or not stages:
        return
    read = [piece.table_angle_rad for piece in recording.pieces()]
    known = [angle for angle in read if angle is not None]
    if len(known) < len(read):
        return
    angle = np.concatenate(known)[windows.first]
    change = np.diff(angle, append=angle[-1])
    change -= 2 * np.pi * np.rint(change / (2 * np.pi))
    turn = (windows.rate - bias) * np.diff(windows.start_s, append=windows.start_s[-1])[:, None]
    follows = np.diff(windows.section, append=windows.section[-1]) == 0
    for number, (stage, (_, mounting)) in enumerate(zip(stages, table.mountings, strict=False)):
        inside = follows & (windows.start_s >= stage.start_s) & (windows.start_s < stage.end_s)
        angles = change[inside]
        if np.abs(angles).sum() < LEAST_RAD:
            continue
        vector = angles @ turn[inside] / (angles @ angles)
        along = float(vector @ mounting[:, 0])
        if abs(along - 1) < ALIKE:
            continue
        place = f"{recording.name}, {stage.start_s:.0f} to {stage.end_s:.0f} s"
        if abs(along + 1) < ALIKE:
            raise RefusedError(
                place,
                "the table's angle rises while the gyros read a turn the other way",
                expected="angles that turn right-handed about the axis of the mounting",
                remedy='put "-" in front of table_angle_column, or correct [table] mountings',
            )
        words = ", ".join(
            f"{part:+.2f} about {axis}" for part, axis in zip(vector, "xyz", strict=True)
        )
        raise RefusedError(
            place,
            f"of each degree of the table's angle the gyros read {words}",
            expected="one degree about the axis of the mounting",
            remedy=f"correct the mounting with number {number + 1} of [table] mountings, or "
            "table_angle_column",
        )
