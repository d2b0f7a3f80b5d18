"""[message.X] of rig.toml, resolved: counter, CRC, status and ID of one message."""

from __future__ import annotations

from dataclasses import replace

from triaxcal.base.errors import RefusedError
from triaxcal.rig.description.buslookup import Names
from triaxcal.rig.description.description import MessageUse, Status
from triaxcal.rig.description.layout import Condition, FrameLayout
from triaxcal.rig.description.protection import PROTECTIONS, Guard, Protection
from triaxcal.rig.description.rigkeys import MessageKeys
from triaxcal.rig.description.signals import Signal

_CLASSIC = 8
"""Bytes of a classic frame."""


def use_of(names: Names, name: str, keys: MessageKeys, channel: str | None) -> MessageUse:
    """One message as the bench uses it.

    Parameters
    ----------
    channel : str or None
        Where its keys name none.

    Raises
    ------
    RefusedError
        Where a key names no signal, or one that cannot be what it should be.
    """
    layout = _with_source(names, names.layouts[name], keys)
    place = f"{names.source}, [message.{name}]"

    def signal(key: str) -> Signal | None:
        given = getattr(keys, key)
        return None if given is None else names.inner(layout, key, given)

    counter, crc, mux = (signal(key) for key in ("counter", "crc", "mux"))
    for one, other in (("crc", "protection"), ("mux", "mux_value")):
        if (getattr(keys, one) is None) != (getattr(keys, other) is None):
            absent = other if getattr(keys, other) is None else one
            raise RefusedError(f"{place} {absent}", "missing", expected=f"{one} and {other}")
    protection = PROTECTIONS[keys.protection] if keys.protection is not None else None
    guard = None
    if crc is not None and protection is not None:
        guard = Guard(crc, layout.frame_id, counter, keys.data_id, keys.data_id_mode)
        _refuse_wrong_guard(place, guard, protection, layout.size)
    own = protection.counter_modulus if protection is not None else 0
    modulus = keys.counter_modulus or own or (1 << counter.length if counter else 0)
    if counter is not None and modulus > 1 << counter.length:
        raise RefusedError(
            f"{place} counter_modulus",
            f"found {modulus}",
            expected=f"at most {1 << counter.length}, the values of {counter.name}",
        )
    if keys.counter_step >= max(modulus, 2):
        raise RefusedError(
            f"{place} counter_step",
            f"found {keys.counter_step}",
            expected=f"at most {modulus - 1}, one less than the values of the counter"
            if modulus
            else "a counter",
        )
    only: tuple[Condition, ...] = ()
    if mux is not None and keys.mux_value is not None:
        _refuse_outside(f"{place} mux_value", mux, (keys.mux_value,))
        only = (Condition(mux, (keys.mux_value,)),)
    return MessageUse(
        layout=layout,
        counter=counter,
        counter_modulus=modulus,
        counter_step=keys.counter_step,
        guard=guard,
        protection=protection,
        statuses=_statuses(names, layout, place, keys),
        only=only,
        channel=keys.channel or channel,
    )


def _statuses(
    names: Names, layout: FrameLayout, place: str, keys: MessageKeys
) -> tuple[Status, ...]:
    """Statuses with their good values: a list of its own for each, or one for all."""
    good = keys.status_good
    goods = [good.of(i) for i in range(len(keys.status))]
    if good.count not in {1, len(keys.status)}:
        raise RefusedError(
            f"{place} status_good",
            f"{good.count} lists",
            expected=f"one list for all, or one for each of the {len(keys.status)} of status",
        )
    found = []
    for name, values in zip(keys.status, goods, strict=True):
        signal = names.inner(layout, "status", name)
        _refuse_outside(f"{place} status_good", signal, values)
        found.append(Status(signal, values))
    return tuple(found)


def _refuse_outside(place: str, signal: Signal, values: tuple[int, ...]) -> None:
    """Refuse raw values that a signal cannot have."""
    low, high = signal.ends
    outside = [value for value in values if not low <= value <= high]
    if outside:
        raise RefusedError(
            place, f"found {outside[0]}", expected=f"{low} to {high}, what {signal.name} holds"
        )


def _with_source(names: Names, layout: FrameLayout, keys: MessageKeys) -> FrameLayout:
    """Layout whose ID matches as the keys say."""
    j1939 = layout.j1939 if keys.j1939 is None else keys.j1939
    place = f"{names.source}, [message.{layout.name}]"
    if j1939 and not layout.extended:
        raise RefusedError(
            f"{place} j1939",
            f"ID 0x{layout.frame_id:X} of 11 bits",
            expected="an ID of 29 bits, as J1939 has them",
        )
    if j1939 and layout.size > _CLASSIC and not layout.fd_stated:
        raise RefusedError(
            place,
            f"{layout.size} bytes, which J1939 sends in several frames",
            expected=f"a message of at most {_CLASSIC} bytes: transport protocol is not read",
            remedy="name signals of another message, or let the unit send them in one frame",
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


def _refuse_wrong_guard(place: str, guard: Guard, protection: Protection, size: int) -> None:
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
    nibble = protection.data_ids == 1 and guard.data_id_mode == "nibble"
    behind = size - guard.place - guard.byte_count
    if guard.place < protection.before or (nibble and not behind):
        raise RefusedError(
            f"{place} crc",
            f"{signal.name} is in byte {guard.place} of 0 to {size - 1}",
            expected="a byte behind it, which holds four bits of the Data ID"
            if nibble
            else f"{protection.before} bytes before it, the header of {protection.label}",
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
