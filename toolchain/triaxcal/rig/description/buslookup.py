"""Names of rig.toml looked up in the bus descriptions; the nearest names where there is none."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Protocol

from triaxcal.base.errors import RefusedError
from triaxcal.rig.description.layout import FrameLayout
from triaxcal.rig.description.recorded import SignalUnit
from triaxcal.rig.description.signals import Signal

_NEAR = 3


class Described(Protocol):
    """What describes messages: a bus description, or the format of lines."""

    @property
    def path(self) -> Path:
        """File."""

    @property
    def sha256(self) -> str:
        """Of its content."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """What breaks the letter of its format."""

    def layouts(self) -> Iterable[FrameLayout]:
        """Layouts of its messages."""


class Names:
    """Signals of the bus descriptions by their full names."""

    def __init__(self, source: str, files: Sequence[Described]) -> None:
        self.source = source
        self.layouts: dict[str, FrameLayout] = {}
        self._twice: set[str] = set()
        for layout in (layout for file in files for layout in file.layouts()):
            if layout.name in self.layouts:
                self._twice.add(layout.name)
            self.layouts[layout.name] = layout
        self._full = {
            f"{layout.name}.{name}": (layout, signal)
            for layout in self.layouts.values()
            for name, signal in layout.signals.items()
        }
        self.files = ", ".join(str(f.path) for f in files)

    def signal(self, key: str, name: str) -> SignalUnit:
        """Signal of a key of [signals]."""
        place = f"{self.source}, [signals] {key}"
        found = self._full.get(name)
        if found is None:
            raise self._missing(place, "signal", name, self._full)
        layout, signal = found
        self._refuse_unfit(place, layout, signal)
        if signal.scale == 0 or not math.isfinite(signal.scale):
            raise RefusedError(
                place,
                f"{name} has the factor {signal.scale:g}: every value is the same",
                expected="the factor of one step",
                remedy=f"correct {self.files}",
            )
        return SignalUnit(layout.name, signal, layout.multiplexed.get(signal.name, ()))

    def message(self, place: str, name: str) -> FrameLayout:
        """Layout of a message."""
        if name not in self.layouts:
            raise self._missing(place, "message", name, self.layouts)
        return self.layouts[name]

    def inner(self, layout: FrameLayout, key: str, name: str) -> Signal:
        """Signal of a key of [message.X]: an integer that is in every frame of the message."""
        place = f"{self.source}, [message.{layout.name}] {key}"
        signal = layout.signals.get(name)
        if signal is None:
            raise self._missing(place, "signal", name, layout.signals)
        self._refuse_unfit(place, layout, signal)
        if signal.is_float or signal.length > 32 or layout.multiplexed.get(name):
            what = (
                "multiplexed" if name in layout.multiplexed else "a float, or longer than 32 bits"
            )
            raise RefusedError(
                place, f"{name} is {what}", expected="an integer of at most 32 bits in every frame"
            )
        return signal

    def _refuse_unfit(self, place: str, layout: FrameLayout, signal: Signal) -> None:
        last = signal.first_byte + signal.byte_count
        if last > layout.size:
            raise RefusedError(
                place,
                f"{layout.name}.{signal.name} needs {last} bytes, and the message has "
                f"{layout.size}",
                remedy=f"correct {self.files}",
            )
        for condition in layout.multiplexed.get(signal.name, ()):
            if not condition.selector.is_plain:
                raise RefusedError(
                    place,
                    f"its multiplexer {condition.selector.name} has a factor or an offset",
                    expected="a plain number: tools differ in what they compare",
                )
        if layout.name in self._twice:
            raise RefusedError(
                place, f"{layout.name} stands in {self.files} twice", expected="one message"
            )

    def _missing(self, place: str, what: str, name: str, known: Iterable[str]) -> RefusedError:
        near = nearest(name, known)
        hint = "; nearest: " + ", ".join(near) if near else ""
        return RefusedError(
            place, f"no {what} {name!r}{hint}", expected=f"a {what} of {self.files}"
        )


def nearest(name: str, known: Iterable[str]) -> list[str]:
    """Names that are most like one."""
    by_lower = {k.lower(): k for k in known}
    near = difflib.get_close_matches(name.lower(), by_lower, n=_NEAR, cutoff=0.4)
    return [by_lower[n] for n in near]
