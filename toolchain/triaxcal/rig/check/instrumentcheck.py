"""`triaxcal rig check` of chamber and positioner: whether they answer, before hours are spent."""

from __future__ import annotations

from collections.abc import Iterator

from triaxcal.base.errors import RefusedError
from triaxcal.base.extras import refuse_missing_packages
from triaxcal.rig.check.check import Finding
from triaxcal.rig.hands.equipment import Connection, Equipment


def instrument_findings(equipment: Equipment) -> list[Finding]:
    """What the instruments of a plan answer; nothing is set or moved."""
    return [*_chamber(equipment), *_positioner(equipment)]


def _chamber(equipment: Equipment) -> Iterator[Finding]:
    chamber, by = equipment.chamber, equipment.chamber_by
    if by.by_hand:
        return
    answer = _answer("chamber", by, chamber.timeout_s)
    if isinstance(answer, Finding):
        yield answer
        return
    if len(answer) < chamber.answer_place:
        yield Finding(False, f"chamber answers {len(answer)} numbers, not {chamber.answer_place}")
        return
    degc = chamber.unit.degc(answer[chamber.answer_place - 1])
    low, high = chamber.range_degc
    found = f"chamber answers {degc:.2f} degC"
    if low <= degc <= high:
        yield Finding(True, found)
    else:
        yield Finding(False, f"{found}, outside range_degc {low:g} to {high:g}: another unit?")


def _positioner(equipment: Equipment) -> Iterator[Finding]:
    positioner, by = equipment.positioner, equipment.positioner_by
    if by.by_hand:
        return
    answer = _answer("positioner", by, positioner.timeout_s)
    if isinstance(answer, Finding):
        yield answer
        return
    wanted = len(positioner.order("TP1").numbers)
    text = ", ".join(f"{value:g}" for value in answer)
    enough = len(answer) >= wanted
    yield Finding(enough, f"positioner answers {text}" + ("" if enough else f", not {wanted}"))


def _answer(name: str, by: Connection, timeout_s: float) -> tuple[float, ...] | Finding:
    """Numbers that an instrument answers, or what is to be said instead."""
    try:
        refuse_missing_packages(f'driver "{by.driver.name}"', by.driver.packages, "instruments")
        if not by.readable:
            return Finding(True, f"{name} cannot be asked: {by.driver.reads or 'it'} is not given")
        instrument = by.driver.open(by.settings, timeout_s)
        try:
            return tuple(instrument.read())
        finally:
            instrument.close()
    except RefusedError as refusal:
        return Finding(False, f"{name}: {refusal}")
