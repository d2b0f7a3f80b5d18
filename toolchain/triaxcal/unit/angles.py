"""[firmware] angles of unit.toml: which angles the device makes of the compensated triad."""

from __future__ import annotations

from dataclasses import dataclass

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


def angles_choice(pair: str, rest_within_g: float, second_from_deg: float) -> AnglesChoice | None:
    """The choice that unit.toml states; None for no angles."""
    return None if pair == NONE else AnglesChoice(pair, rest_within_g, second_from_deg)
