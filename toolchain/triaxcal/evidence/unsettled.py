"""Why no constants describe a recording: a unit beside the axis, or constants that change."""

from __future__ import annotations

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.calibrate import NotSettledError
from triaxcal.dynamic.description import DynamicDescription
from triaxcal.dynamic.restnoise import with_rests
from triaxcal.dynamic.several import read_recordings
from triaxcal.dynamic.survey import survey
from triaxcal.evidence.afresh import beside_the_axis
from triaxcal.evidence.change import halves, largest_jump


def explained(unit: DynamicDescription, refusal: NotSettledError) -> RefusedError:
    """The refusal with its cause: a place beside the table's axis, or the largest jump at rest.

    A jump is one if both parts settle alone; otherwise the refusal stays as it is.
    """
    recording = read_recordings(unit)
    found = survey(recording)
    noise = with_rests(recording.name, found, unit.noise)
    beside = beside_the_axis(recording, unit.noise, unit.state_blocks(), unit.reference_degc)
    if beside is not None:
        return RefusedError(
            refusal.place, refusal.found, expected=refusal.expected,
            remedy=f"explained by: {beside.words}; {beside.remedy}",
        )  # fmt: skip
    jump = largest_jump(found, noise)
    if jump is None:
        return refusal
    try:
        halves(recording, unit.noise, unit.state_blocks(), jump.at_s, unit.reference_degc)
    except RefusedError:
        return refusal
    return RefusedError(
        refusal.place, refusal.found, expected=refusal.expected,
        remedy=f"explained by constants {jump.words}: {jump.remedy}",
    )  # fmt: skip
