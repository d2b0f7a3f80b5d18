"""Turns that an operator can be asked for, and the words for them.

A turn is about an axis of the instrument, right-handed. Up in instrument axes is then

    up' = exp(-[e] angle) up

so that from +z up a turn by 90 deg about +x brings +y up.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from triaxcal.dynamic.blocks.attitude import rotation_of
from triaxcal.model.types import FloatArray

ANGLES_DEG = (45, 90, 180, 360, 720)
RATE_DEG_PER_S = 60.0
"""How fast a hand turns, about."""
HANDLING_S = 1.5
"""Until a turn is begun, and until the unit rests."""
HORIZONTAL = 0.9
"""An axis that leans more to the vertical is not turned about: gravity would not show it."""
_STEP_DEG = 5.0
_AROUND = {360: "once", 720: "twice"}
_FACE = math.cos(math.radians(20.0))
_PART = math.sin(math.radians(20.0))


@dataclass(frozen=True)
class Turn:
    """A turn about an instrument axis.

    Attributes
    ----------
    axis : int
    angle_deg : int
        Signed; 0 is to hold still for longer.
    """

    axis: int
    angle_deg: int

    @property
    def seconds(self) -> float:
        """How long it takes, about."""
        return abs(self.angle_deg) / RATE_DEG_PER_S + (HANDLING_S if self.angle_deg else 0.0)

    def path(self, up: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, float]:
        """Rate (n, 3), rad/s; up (n, 3); rotation to the end (n, 3, 3) at n moments; their step, s.

        The rotations take a vector from the axes of the moment to those of the end.
        """
        count = math.ceil(abs(self.angle_deg) / _STEP_DEG)
        angle = math.radians(self.angle_deg)
        axis = np.eye(3)[self.axis]
        done = angle * (np.arange(count) + 0.5) / count
        rate = np.tile(axis * math.copysign(math.radians(RATE_DEG_PER_S), angle), (count, 1))
        ups = rotation_of(-axis * done[:, None]) @ up
        to_end = rotation_of(-axis * (angle - done)[:, None])
        return rate, ups, to_end, abs(angle) / count / math.radians(RATE_DEG_PER_S)

    def end(self, up: FloatArray) -> FloatArray:
        """Up after the turn, (3,)."""
        ended: FloatArray = rotation_of(-np.eye(3)[self.axis] * math.radians(self.angle_deg)) @ up
        return ended

    def words(self, up: FloatArray) -> str:
        """What to do, from an attitude."""
        if not self.angle_deg:
            return "do not move it"
        axis, end = "xyz"[self.axis], up_words(self.end(up))
        if abs(self.angle_deg) in _AROUND:
            first = up_words(Turn(self.axis, int(math.copysign(90, self.angle_deg))).end(up))
            times = _AROUND[abs(self.angle_deg)]
            return f"turn it {times} around {axis}: until {first}, and on until {end} again"
        return f"turn it by {abs(self.angle_deg)} deg around {axis}, until {end}"


def up_words(up: FloatArray) -> str:
    """Which axis is up: "+z is up", or "up is midway between +y and +z"."""
    names = [f"{'+' if v > 0 else '-'}{'xyz'[i]}" for i, v in enumerate(up)]
    size = np.abs(up)
    if size.max() >= _FACE:
        return f"{names[int(np.argmax(size))]} is up"
    parts = [names[i] for i in range(3) if size[i] > _PART]
    return "up is between " + ", ".join(parts[:-1]) + f" and {parts[-1]}"


def candidates(up: FloatArray, missing: Sequence[int] = ()) -> tuple[Turn, ...]:
    """What may be done next, always in the same order.

    Turns end with an axis up, or with up between two: a hand finds no others. Where the unit leans
    in another way, any turn may be next. Where turns about axes are missing it is one about them,
    or one that lays such an axis level.
    """
    axes = [axis for axis in range(3) if abs(up[axis]) < HORIZONTAL]
    turns = [Turn(axis, sign * angle) for angle in ANGLES_DEG for axis in axes for sign in (1, -1)]
    if missing:
        whole = [turn for turn in turns if turn.axis in missing and abs(turn.angle_deg) in _AROUND]
        return tuple(whole or [t for t in turns if abs(t.end(up)[missing[0]]) < HORIZONTAL])
    simple = [turn for turn in turns if np.abs(turn.end(up)).min() < _PART]
    return (*(simple or turns), Turn(0, 0))
