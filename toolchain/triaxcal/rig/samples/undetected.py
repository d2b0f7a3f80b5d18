"""What nothing on the bus would show: said before a session, and kept in its record."""

from __future__ import annotations

from collections.abc import Iterator

from triaxcal.rig.description.description import RigDescription
from triaxcal.rig.description.layout import ANY_SOURCE
from triaxcal.rig.samples.numbering import LATE_PERIODS, LATE_S


def undetected(rig: RigDescription) -> tuple[str, ...]:
    """Faults that nothing on the bus would show, a sentence each; empty where there are none."""
    return tuple(_sentences(rig))


def _sentences(rig: RigDescription) -> Iterator[str]:
    numbering = [rig.sample_at] if rig.join != "counter" else list(rig.axis_messages)
    if rig.sample_time is None and all(rig.messages[m].counter is None for m in numbering):
        yield (
            f"{rig.sample_at} has no counter: a lost or repeated frame is not seen; a pause counts "
            f"as a loss from {LATE_PERIODS:g} periods and {1000 * LATE_S:g} ms on"
        )
    elif rig.sample_time is None:
        yield "no time of the sample: a loss of whole turns of the counter is seen by arrival alone"
    others = [m for m in rig.messages if m not in numbering and rig.messages[m].counter is None]
    if others:
        yield f"{', '.join(others)}: no counter, lost frames are not counted"
    bare = [name for name, use in rig.messages.items() if use.guard is None]
    if bare:
        yield (
            f"{', '.join(bare)}: no CRC of the payload, a value that is wrong before it is sent "
            "as a frame is not seen"
        )
    if rig.serial is None:
        yield "no serial number: a unit that is another one is not noticed"
    without = [name for name in rig.axis_messages if not rig.messages[name].statuses]
    if len(without) == len(rig.axis_messages):
        yield "no status: a fault that the sensor reports is not seen"
    if rig.join == "age":
        yield (
            f"axes joined by age: a sample may have an axis that is up to {1000 * rig.age_s:g} ms "
            "old"
        )
    anyone = [
        name
        for name, use in rig.messages.items()
        if use.layout.j1939 and use.layout.source_address == ANY_SOURCE
    ]
    if anyone:
        yield f"{', '.join(anyone)}: any J1939 source address, two units cannot be told apart"
