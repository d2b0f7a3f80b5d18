"""A rig description from its keys: every name looked up in the bus description, or refused."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence

from triaxcal.base.errors import RefusedError
from triaxcal.rig.description.buslookup import Described, Names
from triaxcal.rig.description.description import MessageUse, RigDescription, SampleTime
from triaxcal.rig.description.messageuse import use_of
from triaxcal.rig.description.recorded import (
    ACCELERATIONS,
    RATES,
    TEMPERATURES,
    TIMES_US,
    VOLTAGES,
    Recorded,
    SignalUnit,
    folded,
    recorded,
)
from triaxcal.rig.description.rigkeys import MessageKeys, SignalKeys

AXES = ("x", "y", "z")
GYROS = ("gyro_x", "gyro_y", "gyro_z")


def resolved(  # noqa: PLR0917
    name: str,
    source: str,
    sha256: str,
    files: Sequence[Described],
    keys: SignalKeys,
    messages: Mapping[str, MessageKeys],
    channel: str | None = None,
) -> RigDescription:
    """Description of the keys of a rig.toml.

    Parameters
    ----------
    name, source, sha256 : str
        Of the description, of its file for messages, and of its content.
    files : sequence of Described
        Bus descriptions; the first is the rig's.
    channel : str, optional
        Of the messages that name none.

    Raises
    ------
    RefusedError
        As `read_description`.
    """
    names = Names(source, files)
    axes, gyros = _axes(names, keys), _gyros(names, keys)
    sampled = (*axes, *gyros)
    others = {
        key: names.signal(key, text)
        for key in ("temperature", "sample_time", "serial", "rate")
        if (text := getattr(keys, key)) is not None
    }
    used = [axis.message for axis in sampled] + [other.message for other in others.values()]
    for message in messages:
        names.message(f"{source}, [message.{message}]", message)
    uses = {
        m: use_of(names, m, messages.get(m, MessageKeys()), channel) for m in dict.fromkeys(used)
    }
    _refuse_overlaps(names, uses)
    _refuse_two_roles(names, dict(zip((*AXES, *GYROS), sampled, strict=False)) | others, uses)
    _refuse_shared_bits(names, [*sampled, *others.values()], uses)
    _refuse_idle(names, messages, uses)
    join, at = _joining(names, keys, sampled, uses)
    return RigDescription(
        name=name,
        sha256=sha256,
        bus_files=tuple(file.path for file in files),
        bus_sha256=files[0].sha256,
        messages=uses,
        axes=axes,
        gyros=gyros,
        temperature=_temperature(names, keys, others.get("temperature")),
        sample_time=_sample_time(names, keys, sampled, others.get("sample_time")),
        serial=_whole(names, "serial", others.get("serial")),
        serial_is=keys.serial_is,
        rate=_whole(names, "rate", others.get("rate")),
        join=join,
        age_s=keys.age_s or 0.0,
        sample_at=at,
        warnings=tuple(w for file in files for w in file.warnings),
    )


def _axes(names: Names, keys: SignalKeys) -> tuple[Recorded, Recorded, Recorded]:
    x, y, z = _triad(names, keys, AXES, (*ACCELERATIONS, *VOLTAGES), (keys.record, keys.unit))
    return x, y, z


def _gyros(names: Names, keys: SignalKeys) -> tuple[Recorded, ...]:
    """Those of an IMU; none where no key names one."""
    absent = [key for key in GYROS if getattr(keys, key) is None]
    if len(absent) == len(GYROS):
        return ()
    if absent:
        raise RefusedError(
            f"{names.source}, [signals] {absent[0]}", "missing", expected="all three gyros or none"
        )
    return _triad(names, keys, GYROS, RATES, (keys.gyro_record, keys.gyro_unit))


def _triad(
    names: Names,
    keys: SignalKeys,
    wanted: Sequence[str],
    known: Collection[str],
    how: tuple[str | None, str | None],
) -> tuple[Recorded, ...]:
    """Three signals of one kind; `how` they are recorded, and their unit."""
    found = []
    by_signal: dict[str, str] = {}
    for axis in wanted:
        where = names.signal(axis, getattr(keys, axis))
        place = f"{names.source}, [signals] {axis}"
        if where.label in by_signal:
            raise RefusedError(
                place,
                f"{where.label} is {by_signal[where.label]} already",
                expected="a signal for each axis",
            )
        by_signal[where.label] = axis
        found.append(recorded(where, *how, place, known))
    if len({axis.as_value for axis in found}) > 1:
        raise RefusedError(
            f"{names.source}, [signals]",
            "some axes are floats and some are integers",
            expected="axes of one kind",
            remedy='state record = "value" (of gyros, gyro_record)',
        )
    return tuple(found)


def _temperature(names: Names, keys: SignalKeys, where: SignalUnit | None) -> Recorded | None:
    if where is None:
        return None
    place = f"{names.source}, [signals] temperature"
    how, unit = keys.temperature_record, keys.temperature_unit
    return recorded(where, how, unit, place, TEMPERATURES)


def _refuse_overlaps(names: Names, uses: Mapping[str, MessageUse]) -> None:
    seen: list[MessageUse] = []
    for use in uses.values():
        other = next((o for o in seen if o.overlaps(use)), None)
        if other is not None:
            raise RefusedError(
                f"{names.source}, [message.{use.name}]",
                f"its frames cannot be told from those of {other.name}: IDs "
                f"0x{use.layout.frame_id:X} and 0x{other.layout.frame_id:X}",
                expected="an ID for each message",
                remedy="state source_address where J1939 addresses differ, and channel where "
                "buses do",
            )
        seen.append(use)


def _refuse_shared_bits(
    names: Names, signals: Sequence[SignalUnit], uses: Mapping[str, MessageUse]
) -> None:
    """Refuse signals that lie on each other, where both can be in one frame."""
    every = list(signals)
    for use in uses.values():
        crc = use.guard.signal if use.guard is not None else None
        inner = (use.counter, crc, *(status.signal for status in use.statuses))
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


def _refuse_two_roles(
    names: Names, signals: Mapping[str, SignalUnit], uses: Mapping[str, MessageUse]
) -> None:
    """Refuse a signal that two keys name; a counter may be the time of the sample."""
    every = [(f"[signals] {key}", where.label) for key, where in signals.items()]
    for use in uses.values():
        inner = [
            ("counter", use.counter),
            ("crc", use.guard.signal if use.guard is not None else None),
            *(("status", status.signal) for status in use.statuses),
            ("mux", use.only[0].selector if use.only else None),
        ]
        here = ((f"[message.{use.name}] {key}", s) for key, s in inner if s is not None)
        every += [(key, f"{use.name}.{s.name}") for key, s in here]
    roles: dict[str, str] = {}
    for role, label in every:
        other = roles.setdefault(label, role)
        both = {text.rpartition(" ")[2] for text in (other, role)}
        if other != role and both != {"sample_time", "counter"}:
            raise RefusedError(
                f"{names.source}, {role}",
                f"{label} is {other} already",
                expected="a signal of its own",
            )


def _refuse_idle(names: Names, messages: Iterable[str], uses: Mapping[str, MessageUse]) -> None:
    idle = [m for m in messages if m not in uses]
    if idle:
        raise RefusedError(
            f"{names.source}, [message.{idle[0]}]",
            "no key of [signals] names a signal of this message",
            remedy="leave the table out",
        )


def _sample_time(
    names: Names, keys: SignalKeys, axes: Sequence[Recorded], where: SignalUnit | None
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


def _whole(names: Names, key: str, where: SignalUnit | None) -> SignalUnit | None:
    if where is not None and (where.signal.is_float or where.signal.length > 32):
        raise RefusedError(
            f"{names.source}, [signals] {key}",
            f"{where.label} is no integer of 32 bits at most",
            expected="an integer",
        )
    return where


def _joining(
    names: Names,
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
        moduli = {uses[m].turn for m in used}
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
