"""Recordings without the rests or the turns that show anything: refused in one line."""

from __future__ import annotations

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.rests import Quiet
from triaxcal.dynamic.windows import Windows

RESTS_MIN = 6
"""By hand: with fewer, three biases and three scale factors are not seen by gravity."""
AXIS_TURN_MIN_RAD = 2 * np.pi
"""An axis that turned less in all was never put on the table."""


def no_rest(name: str, windows: Windows) -> RefusedError:
    """For a recording in which nothing is at rest."""
    speed = np.linalg.norm(windows.rate, axis=1)
    return RefusedError(
        name,
        f"the unit never rests: half of the time its gyros read more than "
        f"{np.degrees(np.median(speed)):.1f} deg/s",
        expected="rests of a second and more between the turns, in which rate and force stay",
        remedy="put the unit down between the turns, on something that does not move",
    )


def refuse_few_rests(name: str, rests: int, on_table: bool, parts: int) -> None:
    """Refuse what neither a hand nor a table has turned so that anything can be seen.

    `parts` is into how many sections momentary clips have cut the recording.
    """
    if parts - 1 > rests / 2:
        raise RefusedError(
            name,
            f"a gyro clips in {parts - 1} of the turns between {rests} rests: it is saturated",
            expected="rates within the gyros' range",
            remedy="turn more slowly",
        )
    if not on_table and rests < RESTS_MIN:
        raise RefusedError(
            name,
            f"the unit rests {rests} time{'s' * (rests != 1)} only, and no turns on a "
            "table are found",
            expected=f"at least {RESTS_MIN} rests in different attitudes, better 30, or a table",
            remedy="put the unit down for a second and more between turns; on a table that shakes, "
            'state motion = "table" in [dynamic]',
        )


def refuse_missing_axis(name: str, windows: Windows, quiet: Quiet) -> None:
    """Refuse turns about two axes only."""
    turns = np.abs(windows.rate - quiet.bias) * windows.duration_s[:, None]
    for axis, turn in enumerate(turns[~quiet.still].sum(axis=0)):
        if turn < AXIS_TURN_MIN_RAD:
            raise RefusedError(
                name,
                f"turns about axis {'xyz'[axis]} by {turn / (2 * np.pi):.2f} revolutions in all",
                expected="some revolutions about each axis x, y, z in turn",
                remedy="put that axis along the table's and rotate",
            )
