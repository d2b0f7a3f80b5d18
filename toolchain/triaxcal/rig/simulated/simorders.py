"""Faults of the simulated rig, ordered as kind@seconds[:value[:seconds long]]."""

from __future__ import annotations

import re
from dataclasses import dataclass

from triaxcal.base.errors import UsageError
from triaxcal.base.tomltable import did_you_mean, shown

KINDS = {
    "nudge": "value milli-g for 0.3 s",
    "slip": "value micro-g, until the next turn",
    "creep": "value micro-g, exponential with the given time constant",
    "clipped": "x at the end of the ADC's range",
    "stuck": "y gives one code",
    "lose": "value frames lost",
    "duplicate": "value frames sent twice",
    "bitflip": "value frames with one bit flipped",
    "error": "value error frames",
    "busoff": "error frame, silence, then 'restarted'",
    "linkdown": "silence",
    "gone": "silence, then the rig's counters start anew",
    "twonodes": "a second rig sends under the same IDs",
    "serial": "another serial number from then on",
    "status": "value in the status byte",
    "notemp": "no frames of the thermometer",
    "deaf": "chamber and positioner do not answer",
    "kelvin": "the chamber answers in kelvin",
    "runaway": "the chamber goes value K beyond its set point",
    "halt": "a turn that begins now stops half way",
    "astray": "a turn that begins now ends in the next position",
}
_FORM = re.compile(r"([a-z]+)@([0-9.]+)(?::([0-9.]+))?(?::([0-9.]+))?")
_DEFAULTS = {"nudge": (10.0, 0.3), "slip": (30.0, 0.0), "creep": (20.0, 20.0), "lose": (50.0, 0.0),
             "runaway": (20.0, 3600.0)}  # fmt: skip


@dataclass(frozen=True)
class Fault:
    """One fault: what, when in seconds of the session, how much, how long."""

    kind: str
    at_s: float
    value: float
    length_s: float


def read_fault(order: str) -> Fault:
    """Fault of an order such as "slip@1200:38" or "gone@600:1:5".

    Raises
    ------
    UsageError
        When the kind is unknown or the order has another form.
    """
    form = "kind@seconds[:value[:seconds long]], kind one of " + ", ".join(KINDS)
    match = _FORM.fullmatch(order)
    kind = match[1] if match else order
    if match is None or kind not in KINDS:
        raise UsageError(
            "--fault", f"found {shown(order)}{did_you_mean(kind, KINDS)}", expected=form
        )
    value, length = _DEFAULTS.get(kind, (1.0, 5.0))
    try:
        return Fault(kind, float(match[2]), float(match[3] or value), float(match[4] or length))
    except ValueError as error:
        raise UsageError("--fault", f"found {shown(order)}", expected=form) from error
