"""Why no constants describe a recording: whether two parts of it each have some."""

from __future__ import annotations

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.calibrate import NotSettledError
from triaxcal.dynamic.description import DynamicDescription
from triaxcal.dynamic.restnoise import with_rests
from triaxcal.dynamic.several import read_recordings
from triaxcal.dynamic.survey import survey
from triaxcal.evidence.change import REMEDY, halves, largest_jump


def explained(unit: DynamicDescription, refusal: NotSettledError) -> RefusedError:
    """The refusal, with the largest jump at rest as its cause if both parts settle alone.

    If a part is refused as well, the refusal stays as it is.
    """
    recording = read_recordings(unit)
    found = survey(recording)
    noise = with_rests(recording.name, found, unit.noise)
    jump = largest_jump(found, noise)
    if jump is None:
        return refusal
    try:
        halves(recording, unit.noise, unit.state_blocks(), jump.at_s, unit.reference_degc)
    except RefusedError:
        return refusal
    return RefusedError(
        refusal.place, refusal.found, expected=refusal.expected,
        remedy=f"explained by constants {jump.words}: {REMEDY}",
    )  # fmt: skip
