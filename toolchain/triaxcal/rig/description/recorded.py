"""What is recorded of a signal, and what one step of it is in g, degC or microseconds.

Of an integer signal the raw number is recorded, as the firmware has it: scale and offset of the bus
description say only what it means. Of a float there is no raw code: the physical value is divided
by the reading of one code of unit.toml, and is what the firmware's code would be before rounding.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import shown
from triaxcal.rig.description.layout import Condition
from triaxcal.rig.description.signals import Signal

_G = 9.80665
ACCELERATIONS: Mapping[str, float] = MappingProxyType(
    {
        "g": 1.0, "gn": 1.0, "g0": 1.0, "mg": 1e-3, "milli-g": 1e-3, "ug": 1e-6, "micro-g": 1e-6,
        "m/s^2": 1 / _G, "m/s2": 1 / _G, "m/s²": 1 / _G, "m/s/s": 1 / _G, "m/ss": 1 / _G,
        "m/sec^2": 1 / _G, "m/s**2": 1 / _G, "mm/s^2": 1e-3 / _G, "cm/s^2": 1e-2 / _G,
        "ft/s^2": 0.3048 / _G,
    }
)  # fmt: skip
"""Units of acceleration in bus descriptions, lower case without blanks, in g."""
RATES: Mapping[str, float] = MappingProxyType(
    {
        **dict.fromkeys(("deg/s", "°/s", "deg/sec", "degree/s", "degrees/s", "dps"), 1.0),
        **dict.fromkeys(("mdeg/s", "m°/s", "mdps"), 1e-3),
        **dict.fromkeys(("deg/h", "°/h", "dph"), 1 / 3600),
        **dict.fromkeys(("rad/s", "rad/sec", "rads"), 180 / math.pi),
        "mrad/s": 0.18 / math.pi,
    }
)
"""Units of rate in bus descriptions, lower case without blanks, in deg/s."""
TEMPERATURES: Mapping[str, tuple[float, float]] = MappingProxyType(
    {
        **dict.fromkeys(
            (
                "degc",
                "°c",
                "c",
                "celsius",
                "degreec",
                "deg.c",
                "gradc",
                "deg_c",
                "cel",
                "degcelsius",
            ),
            (1.0, 0.0),
        ),
        **dict.fromkeys(("k", "kelvin", "degk"), (1.0, -273.15)),
        **dict.fromkeys(("degf", "°f", "f"), (5.0 / 9.0, -160.0 / 9.0)),
    }
)
"""Units of temperature: T in degC = value * first + second."""
TIMES_US: Mapping[str, float] = MappingProxyType(
    {"ns": 1e-3, "us": 1.0, "µs": 1.0, "μs": 1.0, "ms": 1e3, "s": 1e6, "sec": 1e6}
)
VOLTAGES: Mapping[str, float] = MappingProxyType({"v": 1.0, "mv": 1e-3})
CODES = frozenset({"code", "codes", "lsb", "count", "counts", "digit", "digits"})
"""Units of raw codes: scale and offset would make other codes of them."""


def folded(unit: str) -> str:
    """A unit without the differences that mean nothing."""
    return "".join(unit.lower().split()).replace("(", "").replace(")", "").strip("[]")


def unit_of(text: str) -> str:
    """Unit of a bus description as unit.toml names it; "" where it is none that is known."""
    known = folded(text)
    names = [
        *((ACCELERATIONS, name) for name in ("m/s^2", "g", "mg")),
        *((VOLTAGES, name) for name in ("V", "mV")),
        *((RATES, name) for name in ("deg/s", "rad/s", "deg/h")),
        *((TEMPERATURES, name) for name in ("degC", "K", "degF")),
    ]
    for table, name in names:
        if known in table and table[known] == table[folded(name)]:
            return name
    tables = (ACCELERATIONS, VOLTAGES, RATES, TEMPERATURES, CODES)
    return text if any(known in table for table in tables) else ""


@dataclass(frozen=True)
class SignalUnit:
    """A signal with its message and the conditions under which it is in a payload."""

    message: str
    signal: Signal
    conditions: tuple[Condition, ...] = ()

    @property
    def label(self) -> str:
        """Name as rig.toml has it."""
        return f"{self.message}.{self.signal.name}"


@dataclass(frozen=True)
class Recorded(SignalUnit):
    """A signal that is recorded.

    Attributes
    ----------
    as_value : bool
        The physical value is recorded, not the raw integer.
    unit : str
        Of the physical value, folded; "" where nothing says it.
    """

    as_value: bool = False
    unit: str = ""

    @property
    def said(self) -> str:
        """What is recorded, in words."""
        return f"{self.label}: {self._what}" + (f"; {self.none_said}" if self.none_said else "")

    @property
    def _what(self) -> str:
        if not self.as_value:
            return "the raw integer"
        if self.is_code:
            return "its value, a code"
        return f"its value in {self.unit}, divided by the reading of one code"

    @property
    def none_said(self) -> str:
        """Which raw integers are taken for no value, in words; empty where none are."""
        named = ", ".join(f"{raw} ({name})" for raw, name in self.signal.no_values)
        return f"no value: {named}" if named else ""

    @property
    def step(self) -> float:
        """Physical value of one step of what is recorded."""
        return 1.0 if self.as_value else self.signal.scale

    @property
    def zero(self) -> float:
        """Physical value where what is recorded is 0."""
        return 0.0 if self.as_value else self.signal.offset

    @property
    def g(self) -> tuple[float, float] | None:
        """One step in g, and where it is 0 g; None where the unit is no acceleration."""
        unit = ACCELERATIONS.get(self.unit)
        return None if unit is None else (self.step * unit, -self.zero / self.step)

    @property
    def degc(self) -> tuple[float, float] | None:
        """T = recorded * first + second; None where the unit is no temperature."""
        unit = TEMPERATURES.get(self.unit)
        return None if unit is None else (self.step * unit[0], self.zero * unit[0] + unit[1])

    @property
    def is_code(self) -> bool:
        """The physical value is a code itself."""
        return self.unit in CODES


def recorded(
    where: SignalUnit,
    record: str | None,
    unit: str | None,
    place: str,
    known: Collection[str],
) -> Recorded:
    """What is recorded of a signal.

    Parameters
    ----------
    record : str or None
        "raw", "value", or None where its kind decides.
    unit : str or None
        Of the physical value, in place of what the bus description says.
    place : str
        Key of rig.toml, for messages.
    known : collection of str
        Units that the quantity may have besides codes, folded.

    Raises
    ------
    RefusedError
        Where the unit is of another quantity; where raw numbers of a float are wanted; where the
        bus description makes other codes of codes.
    """
    signal = where.signal
    stated = folded(unit if unit is not None else signal.unit)
    name = f"{place}, {where.label}"
    if stated and stated not in CODES and stated not in known:
        raise RefusedError(
            name,
            f"its unit is {shown(unit if unit is not None else signal.unit)}",
            expected="code, or one of " + ", ".join(list(known)[:8]),
            remedy="name another signal, or state the unit in rig.toml",
        )
    if signal.is_float and record == "raw":
        raise RefusedError(name, "it is a float and has no raw code", expected='"value"')
    if record is None and not signal.is_float and not signal.is_plain and stated in CODES:
        raise RefusedError(
            name,
            f"the bus description makes {signal.scale:g} * raw + {signal.offset:g} {stated} of it",
            expected="scale 1 and offset 0 of a signal whose unit is a code",
            remedy='correct the unit, or state in rig.toml which is recorded: record = "raw", or '
            '"value" (of the temperature: temperature_record)',
        )
    as_value = record == "value" or (record is None and signal.is_float)
    if as_value and not stated:
        raise RefusedError(
            name,
            "its value is recorded, and nothing says its unit",
            expected="a unit in the bus description",
            remedy='state unit (temperature_unit) in rig.toml; "code" if it is a code itself',
        )
    return Recorded(where.message, signal, where.conditions, as_value, stated)
