"""What was found in the recording of an IMU, and of effects that are off, in words."""

from __future__ import annotations

import numpy as np

from triaxcal.dynamic.calibrate import DynamicResult
from triaxcal.dynamic.missing import Effect
from triaxcal.dynamic.survey import Survey
from triaxcal.dynamic.unit import DynamicUnit

STAYS_OFF_SD = 0.5
"""An effect that moves no constant by more of its standard deviations may stay off."""


def recorded_words(done: DynamicUnit) -> list[str]:
    """What the reader found, the first rest, and the rests."""
    found = done.result.survey
    first = f"first {found.sections[0].still_s:.0f} s at rest, {axis_up(done.result)} up"
    return [*done.findings, first, rests_words(found)]


def axis_up(result: DynamicResult) -> str:
    """The instrument axis that pointed up most at the start, by the force: "+z"."""
    force = result.survey.sections[0].force
    axis = int(np.argmax(np.abs(force)))
    return f"{'+' if force[axis] > 0 else '-'}{'xyz'[axis]}"


def rests_words(found: Survey) -> str:
    """Rests, their guards, and that no turn is the table's where none is."""
    lengths = [rest.duration_s for rest in found.rests]
    turns = "" if found.stages else "; no turns on a table"
    return (
        f"{len(lengths)} rests of {min(lengths):.1f} to {max(lengths):.1f} s, guards of "
        f"{found.guard_s:.1f} s{turns}"
    )


def effect_words(effect: Effect) -> str:
    """What to do about an effect that shows."""
    moves = f"moves no constant by more than {effect.moves_sd:.2g} standard deviations"
    return (
        f"{moves}; it may stay off" if effect.moves_sd < STAYS_OFF_SD else f"{moves}; switch it on"
    )
