"""A rig description from its keys: every name looked up in the bus description, or refused."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Protocol

from triaxcal.base.errors import RefusedError
from triaxcal.rig.description import MessageUse, RigDescription, SampleTime
from triaxcal.rig.layout import Condition, FrameLayout
from triaxcal.rig.protection import PROTECTIONS, Guard
from triaxcal.rig.recorded import (
    ACCELERATIONS,
    TEMPERATURES,
    TIMES_US,
    VOLTAGES,
    Recorded,
    SignalUnit,
    folded,
    recorded,
)
from triaxcal.rig.rigkeys import MessageKeys, SignalKeys
from triaxcal.rig.signals import Signal

AXES = ("x", "y", "z")
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


class _Names:
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


def resolved(  # noqa: PLR0917
    name: str,
    source: str,
    sha256: str,
    files: Sequence[Described],
    keys: SignalKeys,
    messages: Mapping[str, MessageKeys],
) -> RigDescription:
    """Description of the keys of a rig.toml.

    Parameters
    ----------
    name, source, sha256 : str
        Of the description, of its file for messages, and of its content.
    files : sequence of Described
        Bus descriptions; the first is the rig's.

    Raises
    ------
    RefusedError
        As `read_description`.
    """
    names = _Names(source, files)
    axes = _axes(names, keys)
    others = {
        key: names.signal(key, text)
        for key in ("temperature", "sample_time", "serial", "rate")
        if (text := getattr(keys, key)) is not None
    }
    used = [axis.message for axis in axes] + [other.message for other in others.values()]
    for message in messages:
        names.message(f"{source}, [message.{message}]", message)
    uses = {m: _use(names, m, messages.get(m, MessageKeys())) for m in dict.fromkeys(used)}
    _refuse_overlaps(names, uses)
    _refuse_shared_bits(names, [*axes, *others.values()], uses)
    _refuse_idle(names, messages, uses)
    join, at = _joining(names, keys, axes, uses)
    return RigDescription(
        name=name,
        sha256=sha256,
        bus_files=tuple(file.path for file in files),
        bus_sha256=files[0].sha256,
        messages=uses,
        axes=axes,
        temperature=_temperature(names, keys, others.get("temperature")),
        sample_time=_sample_time(names, keys, axes, others.get("sample_time")),
        serial=_whole(names, "serial", others.get("serial")),
        serial_is=keys.serial_is,
        rate=_whole(names, "rate", others.get("rate")),
        join=join,
        age_s=keys.age_s or 0.0,
        sample_at=at,
        warnings=tuple(w for file in files for w in file.warnings),
    )


def _axes(names: _Names, keys: SignalKeys) -> tuple[Recorded, Recorded, Recorded]:
    found = []
    by_signal: dict[str, str] = {}
    for axis in AXES:
        where = names.signal(axis, getattr(keys, axis))
        place = f"{names.source}, [signals] {axis}"
        if where.label in by_signal:
            raise RefusedError(
                place,
                f"{where.label} is {by_signal[where.label]} already",
                expected="a signal for each axis",
            )
        by_signal[where.label] = axis
        known = (*ACCELERATIONS, *VOLTAGES)
        found.append(recorded(where, keys.record, keys.unit, place, known))
    x, y, z = found
    if len({axis.as_value for axis in found}) > 1:
        raise RefusedError(
            f"{names.source}, [signals]",
            "some axes are floats and some are integers",
            expected="axes of one kind",
            remedy='state record = "value"',
        )
    return x, y, z


def _temperature(names: _Names, keys: SignalKeys, where: SignalUnit | None) -> Recorded | None:
    if where is None:
        return None
    place = f"{names.source}, [signals] temperature"
    how, unit = keys.temperature_record, keys.temperature_unit
    return recorded(where, how, unit, place, TEMPERATURES)


def _use(names: _Names, name: str, keys: MessageKeys) -> MessageUse:
    layout = _with_source(names, names.layouts[name], keys)
    place = f"{names.source}, [message.{name}]"

    def signal(key: str) -> Signal | None:
        given = getattr(keys, key)
        return None if given is None else names.inner(layout, key, given)

    counter, crc, status, mux = (signal(key) for key in ("counter", "crc", "status", "mux"))
    for one, other in (("crc", "protection"), ("mux", "mux_value")):
        if (getattr(keys, one) is None) != (getattr(keys, other) is None):
            absent = other if getattr(keys, other) is None else one
            raise RefusedError(f"{place} {absent}", "missing", expected=f"{one} and {other}")
    protection = PROTECTIONS[keys.protection] if keys.protection is not None else None
    guard = None
    if crc is not None and protection is not None:
        guard = Guard(crc, layout.frame_id, counter, keys.data_id, keys.data_id_mode)
        _refuse_wrong_guard(place, guard, protection.name)
    own = protection.counter_modulus if protection is not None else 0
    modulus = keys.counter_modulus or own or (1 << counter.length if counter else 0)
    if counter is not None and modulus > 1 << counter.length:
        raise RefusedError(
            f"{place} counter_modulus",
            f"found {modulus}",
            expected=f"at most {1 << counter.length}, the values of {counter.name}",
        )
    only = (Condition(mux, (keys.mux_value,)),) if mux and keys.mux_value is not None else ()
    return MessageUse(layout, counter, modulus, guard, protection, status, keys.status_good, only)


def _with_source(names: _Names, layout: FrameLayout, keys: MessageKeys) -> FrameLayout:
    """Layout whose ID matches as the keys say."""
    j1939 = layout.j1939 if keys.j1939 is None else keys.j1939
    place = f"{names.source}, [message.{layout.name}]"
    if j1939 and not layout.extended:
        raise RefusedError(
            f"{place} j1939",
            f"ID 0x{layout.frame_id:X} of 11 bits",
            expected="an ID of 29 bits, as J1939 has them",
        )
    if keys.source_address is None:
        return replace(layout, j1939=j1939)
    if not j1939:
        raise RefusedError(
            f"{place} source_address",
            "given for an ID that is not J1939's",
            expected="j1939 = true",
        )
    return replace(layout, j1939=True, frame_id=(layout.frame_id & ~0xFF) | keys.source_address)


def _refuse_wrong_guard(place: str, guard: Guard, name: str) -> None:
    protection = PROTECTIONS[name]
    signal = guard.signal
    aligned = signal.start % 8 == (0 if signal.little_endian else 7)
    if signal.length not in protection.bits or not aligned:
        bits = " or ".join(map(str, protection.bits))
        raise RefusedError(
            f"{place} crc",
            f"{signal.name} has {signal.length} bits from bit {signal.start}",
            expected=f"{bits} bits in whole bytes, the CRC of {protection.label}",
        )
    if len(guard.data_ids) != protection.data_ids:
        raise RefusedError(
            f"{place} data_id",
            f"{len(guard.data_ids)} numbers",
            expected=f"{protection.data_ids} for {protection.label}",
        )
    largest = {8: 0xFFFF, 16: 0xFFFF, 32: 0xFFFFFFFF}[signal.length]
    largest = 0xFF if protection.data_ids > 1 else largest
    if any(data_id > largest for data_id in guard.data_ids):
        raise RefusedError(
            f"{place} data_id", f"found {max(guard.data_ids)}", expected=f"at most {largest}"
        )
    needs_counter = protection.data_ids > 1 or guard.data_id_mode == "alternating"
    if protection.data_ids and needs_counter and guard.counter is None:
        raise RefusedError(
            f"{place} counter", "missing", expected=f"the counter that {protection.label} uses"
        )


def _refuse_overlaps(names: _Names, uses: Mapping[str, MessageUse]) -> None:
    seen: list[MessageUse] = []
    for use in uses.values():
        other = next((o for o in seen if o.layout.overlaps(use.layout)), None)
        if other is not None:
            raise RefusedError(
                f"{names.source}, [message.{use.name}]",
                f"its frames cannot be told from those of {other.name}: IDs "
                f"0x{use.layout.frame_id:X} and 0x{other.layout.frame_id:X}",
                expected="an ID for each message",
                remedy="state source_address where J1939 addresses differ",
            )
        seen.append(use)


def _refuse_shared_bits(
    names: _Names, signals: Sequence[SignalUnit], uses: Mapping[str, MessageUse]
) -> None:
    """Refuse signals that lie on each other, where both can be in one frame."""
    every = list(signals)
    for use in uses.values():
        crc = use.guard.signal if use.guard is not None else None
        inner = (use.counter, crc, use.status)
        every += [SignalUnit(use.name, signal) for signal in inner if signal is not None]
    for i, one in enumerate(every):
        for other in every[:i]:
            both = one.conditions == other.conditions or not (one.conditions and other.conditions)
            same = one.message == other.message and one.signal != other.signal
            if same and both and one.signal.bits & other.signal.bits:
                raise RefusedError(
                    f"{names.source}, {one.label}",
                    f"shares bits with {other.signal.name}",
                    expected="bits of its own",
                    remedy=f"correct {names.files}, or name another signal",
                )


def _refuse_idle(names: _Names, messages: Iterable[str], uses: Mapping[str, MessageUse]) -> None:
    idle = [m for m in messages if m not in uses]
    if idle:
        raise RefusedError(
            f"{names.source}, [message.{idle[0]}]",
            "no key of [signals] names a signal of this message",
            remedy="leave the table out",
        )


def _sample_time(
    names: _Names, keys: SignalKeys, axes: Sequence[Recorded], where: SignalUnit | None
) -> SampleTime | None:
    if where is None:
        return None
    place = f"{names.source}, [signals] sample_time"
    unit = TIMES_US.get(folded(where.signal.unit))
    tick_us = keys.sample_tick_us or (unit and unit * where.signal.scale)
    if where.signal.is_float or where.signal.length > 32 or where.signal.signed:
        raise RefusedError(
            place, f"{where.label} is no clock", expected="an unsigned integer of 32 bits at most"
        )
    if not tick_us:
        raise RefusedError(
            place,
            f"{where.label} has the unit {where.signal.unit!r}",
            expected="one of " + ", ".join(TIMES_US),
            remedy="state sample_tick_us",
        )
    if not any((a.message, a.conditions) == (where.message, where.conditions) for a in axes):
        raise RefusedError(
            place, f"{where.label} comes with no axis", expected="a signal beside an axis"
        )
    return SampleTime(where, float(tick_us))


def _whole(names: _Names, key: str, where: SignalUnit | None) -> SignalUnit | None:
    if where is not None and (where.signal.is_float or where.signal.length > 32):
        raise RefusedError(
            f"{names.source}, [signals] {key}",
            f"{where.label} is no integer of 32 bits at most",
            expected="an integer",
        )
    return where


def _joining(
    names: _Names,
    keys: SignalKeys,
    axes: Sequence[Recorded],
    uses: Mapping[str, MessageUse],
) -> tuple[str, str]:
    """How axes belong together, and the message whose arrival makes a sample."""
    place = f"{names.source}, [signals]"
    parts = dict.fromkeys((axis.message, axis.conditions) for axis in axes)
    used = dict.fromkeys(message for message, _ in parts)
    at = keys.sample_at or axes[2].message
    if at not in used:
        raise RefusedError(
            f"{place} sample_at", f"found {at!r}", expected="one of " + ", ".join(used)
        )
    if len(parts) == 1:
        return "", at
    if keys.join is None:
        raise RefusedError(
            f"{place} join",
            f"missing; the axes come in {len(parts)} frames",
            expected='"counter" where equal counters belong together, or "age"',
        )
    if keys.join == "counter":
        without = [m for m in used if uses[m].counter is None]
        if without:
            raise RefusedError(
                f"{place} join",
                f'"counter", and [message.{without[0]}] has none',
                expected='a counter in each, or join = "age"',
            )
        moduli = {uses[m].counter_modulus for m in used}
        if len(moduli) > 1:
            raise RefusedError(
                f"{place} join",
                "the counters have " + ", ".join(map(str, sorted(moduli))) + " values",
                expected="counters that turn together",
            )
    if (keys.join == "age") != (keys.age_s is not None):
        found = "missing" if keys.age_s is None else f"given for join = {keys.join!r}"
        raise RefusedError(f"{place} age_s", found, expected='a time with join = "age"')
    return keys.join, at
