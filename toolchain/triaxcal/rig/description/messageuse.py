"""[message.X] of rig.toml, resolved: counter, CRC, status and ID of one message."""

from __future__ import annotations

from dataclasses import replace

from triaxcal.base.errors import RefusedError
from triaxcal.rig.description.buslookup import Names
from triaxcal.rig.description.description import MessageUse
from triaxcal.rig.description.layout import Condition, FrameLayout
from triaxcal.rig.description.protection import PROTECTIONS, Guard
from triaxcal.rig.description.rigkeys import MessageKeys
from triaxcal.rig.description.signals import Signal


def use_of(names: Names, name: str, keys: MessageKeys) -> MessageUse:
    """One message as the bench uses it.

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
