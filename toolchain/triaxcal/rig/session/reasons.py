"""Why something was refused or must be repeated: a value with its numbers; text is made last."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum


class Why(Enum):
    """Kinds of reason, each with its text."""

    BUS_OFF = "error frames: {names}"
    BUS_ERRORS = "{count} error frames: {names}"
    ORPHANS = "{count} frames without their partner: another node sends under the rig's IDs"
    JUMPS = "{count} jumps of the counters in 1 s: another node sends under the rig's IDs"
    CONFLICT = (
        "{count} samples in 1 s have the counter of the one before and other values: two nodes "
        "send under the rig's IDs, or the counter does not count"
    )
    GAP = "gap of {seconds} s or more without samples"
    RESTARTED = "the counters jumped: the rig restarted"
    LOST_IN_SECOND = "{lost} of {expected} samples lost in 1 s"
    INVALID = "{count} values in 1 s are no numbers or not available"
    LOST = "{lost} of {expected} samples lost"
    CLIPPED = "clipped: {count} samples at the end of the ADC's range"
    STUCK = "stuck: {axes} gives the same code all the time"
    STATUS = "the rig reports status 0x{status:02X}"
    NO_TEMPERATURE = "no temperature from the rig"
    MOVED = "moved by {micro_g:.0f} micro-g on {axis}"
    SHAKEN = "shaken: variance on {axis} {ratio:.1f} times that at rest"
    TURNED = "turned away"
    SLIP = "slip of {micro_g:.0f} micro-g on {axis} {when}"
    SETTLING = "creep of {micro_g:.0f} micro-g with about {tau_s:.0f} s on {axis}"
    CREEP = "creep of {micro_g_per_min:+.1f} micro-g/min on {axis}"
    NOISE = "noise on {axis} {ratio:.2f} times that at rest"
    UNCERTAIN = "u(A) of {axis} is {micro_g:.1f} micro-g, more than {limit:g}"
    SLIPPED = "it slipped"
    WARMED = "its temperature changed by {kelvin:.0f} K"


@dataclass(frozen=True)
class Reason:
    """A reason and its numbers; `at_s` counts from the start of the averaging."""

    why: Why
    values: Mapping[str, float | str]

    def __str__(self) -> str:
        at_s = self.values.get("at_s")
        when = when_of(int(at_s)) if at_s is not None else ""
        return self.why.value.format(**self.values, when=when)


def because(why: Why, **values: float | str) -> Reason:
    """Reason of a kind with its numbers."""
    return Reason(why, values)


def when_of(at_s: int) -> str:
    """Moment of a dwell, counted from the start of the averaging, in words."""
    return f"at {at_s} s" if at_s >= 0 else "while settling"
