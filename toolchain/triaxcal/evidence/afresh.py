"""An effect that is off, tried by a whole solution: one pass about a wrong result is not enough.

A unit a hand's breadth beside the table's axis feels forces that are larger than all its errors.
Constants that have taken them up are too far off for a trial that is linear about them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.blocks.block import StateBlock
from triaxcal.dynamic.blocks.registry import EXTENSIONS
from triaxcal.dynamic.calibrate import calibrate_dynamic
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.dynamic.survey import survey
from triaxcal.evidence.case import Case
from triaxcal.evidence.chance import largest
from triaxcal.evidence.suspect import Suspect

LEVER_ARM = "lever-arm"


def solved_beside_the_axis(case: Case) -> Suspect | None:
    """The recording with a unit beside the table's axis; None without a table, or if it is on."""
    result = case.result
    blocks = case.chosen_blocks
    if not result.survey.stages or any(b.name == LEVER_ARM for b in blocks):
        return None
    unknown: dict[str, Any] = dict.fromkeys(result.estimated)
    stated = replace(case.noise, **unknown)
    return beside_the_axis(case.recording, stated, blocks, result.frame.reference_degc)


def beside_the_axis(
    recording: ImuRecording, noise: DataSheet, blocks: tuple[StateBlock, ...], reference_degc: float
) -> Suspect | None:
    """The same of a recording without a result; None where this does not settle or fit either."""
    if not survey(recording).stages or any(b.name == LEVER_ARM for b in blocks):
        return None
    entry = EXTENSIONS[LEVER_ARM]
    try:
        found = calibrate_dynamic(
            recording, noise, (*blocks, *entry.blocks), reference_degc=reference_degc
        )
    except RefusedError:
        return None
    last = found.passes[-1]
    if last.chi_square > largest(last.freedom):
        return None
    return Suspect(
        f"{entry.label[0].lower()}{entry.label[1:].rstrip('.')}: the block is switched off",
        f'switch on "{LEVER_ARM}" in [dynamic] blocks',
        (last.chi_square, last.freedom),
        None,
        direct=True,
    )
