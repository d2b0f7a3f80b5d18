"""Angles of the device: keys of [firmware], and of an IMU's [device], and what they choose."""

from __future__ import annotations

from dataclasses import dataclass

from triaxcal.base.keys import setting
from triaxcal.base.kinds import number, word
from triaxcal.model.orientation import AIRCRAFT, INCLINOMETER

NONE, ZENITH_TOOL_FACE, PITCH_ROLL = "none", "zenith-tool-face", "pitch-roll"
ANGLES = (NONE, ZENITH_TOOL_FACE, PITCH_ROLL)
KINDS = {ZENITH_TOOL_FACE: INCLINOMETER, PITCH_ROLL: AIRCRAFT}
"""Convention of `model.orientation` that each pair follows."""
ANGLE_NAMES = {ZENITH_TOOL_FACE: ("zenith", "tool face"), PITCH_ROLL: ("pitch", "roll")}

REST_WITHIN_G = 0.05
SECOND_FROM_DEG = 1.0


@dataclass(frozen=True)
class AnglesChoice:
    """Angles of the device.

    Attributes
    ----------
    pair : str
        `ZENITH_TOOL_FACE` or `PITCH_ROLL`.
    rest_within_g : float
        |a| further than this from 1 g is flagged: the unit is not at rest.
    second_from_deg : float
        The second angle is flagged when its axis is nearer to the plumb line than this.
    """

    pair: str
    rest_within_g: float = REST_WITHIN_G
    second_from_deg: float = SECOND_FROM_DEG

    @property
    def names(self) -> tuple[str, str]:
        """The two angles in words."""
        return ANGLE_NAMES[self.pair]

    @property
    def kind(self) -> str:
        """Convention of `model.orientation`."""
        return KINDS[self.pair]


@dataclass(frozen=True)
class AngleKeys:
    """The keys.

    Attributes
    ----------
    angles
        Which two angles triax_angles makes of the compensated acceleration; none leaves it out.
    rest_within_g
        Of triax_angles: |a| further than this from 1 g is flagged, the unit is not at rest.
    second_angle_from_deg
        Of triax_angles: tool face, or roll, is flagged as poor where its axis is nearer to the
        plumb line than this.
    """

    angles: str = setting(word(ANGLES), NONE)
    rest_within_g: float = setting(number(1e-4, 0.9), REST_WITHIN_G, "g")
    second_angle_from_deg: float = setting(number(1e-3, 45.0), SECOND_FROM_DEG, "deg")

    @property
    def choice(self) -> AnglesChoice | None:
        """What they state; None for no angles."""
        if self.angles == NONE:
            return None
        return AnglesChoice(self.angles, self.rest_within_g, self.second_angle_from_deg)
