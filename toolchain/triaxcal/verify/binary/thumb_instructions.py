"""What the instructions of Thumb do, by mnemonic."""

from __future__ import annotations

from collections.abc import Callable

from triaxcal.verify.binary.machine import State, decided
from triaxcal.verify.binary.thumb_operands import (
    address,
    get,
    jump,
    listed,
    move,
    put,
    source,
    target,
)
from triaxcal.verify.binary.values import UnprovenError, Value, constant, shift_of


def _load(state: State, operands: tuple[str, ...]) -> None:
    base, offset, after = address(state, operands)
    put(state, operands[0], state.load(base, offset))
    if after:
        move(state, *after)


def _compare(state: State, operands: tuple[str, ...]) -> None:
    state.compared = (
        "difference",
        get(state, operands[0]),
        source(state, operands[1]),
    )


def _store(state: State, operands: tuple[str, ...]) -> None:
    base, offset, after = address(state, operands)
    state.store(base, get(state, operands[0]), offset)
    if after:
        move(state, *after)


def _load_two(state: State, operands: tuple[str, ...]) -> None:
    base, offset, _ = address(state, operands)
    first, second = state.load(base, offset), state.load(base, offset + 4)
    put(state, operands[0], first)
    put(state, operands[1], second)


def _store_two(state: State, operands: tuple[str, ...]) -> None:
    base, offset, _ = address(state, operands)
    state.store(base, get(state, operands[0]), offset)
    state.store(base, get(state, operands[1]), offset + 4)


def _load_many(state: State, operands: tuple[str, ...]) -> None:
    base, moves = operands[0].removesuffix("!"), operands[0].endswith("!")
    names = listed(operands[1])
    at = get(state, base)
    values = [state.load(at, 4 * i) for i in range(len(names))]
    if moves:
        move(state, base, 4 * len(names))
    for name, value in zip(names, values, strict=True):
        put(state, name, value)


def _store_many(state: State, operands: tuple[str, ...]) -> None:
    base, moves = operands[0].removesuffix("!"), operands[0].endswith("!")
    names = listed(operands[1])
    at = get(state, base)
    for i, name in enumerate(names):
        state.store(at, get(state, name), 4 * i)
    if moves:
        move(state, base, 4 * len(names))


def _push(state: State, operands: tuple[str, ...]) -> None:
    if operands[:-1] not in ((), ("sp!",)):
        raise UnprovenError("a form of address that the proof does not know")
    names = listed(operands[-1])
    move(state, "sp", -4 * len(names))
    for i, name in enumerate(names):
        state.store(get(state, "sp"), get(state, name), 4 * i)


def _pop(state: State, operands: tuple[str, ...]) -> None:
    _load_many(state, ("sp!", operands[-1]))


def _call(state: State, operands: tuple[str, ...]) -> None:
    state.registers["lr"] = constant(state.pc | 1)
    state.pc = target(operands[0])


def _branch(state: State, operands: tuple[str, ...]) -> None:
    state.pc = target(operands[0])


def _return(state: State, operands: tuple[str, ...]) -> None:
    state.pc = jump(get(state, operands[0]))


def _long(state: State, operands: tuple[str, ...]) -> None:
    """Smull."""
    words = state.words
    a, b = (words.signed(get(state, o)) for o in operands[2:])
    low, high = words.halves(words.multiply(a, b))
    put(state, operands[0], low)
    put(state, operands[1], words.named(high))


def _long_sum(state: State, operands: tuple[str, ...]) -> None:
    """Smlal."""
    words = state.words
    so_far = words.wide(get(state, operands[0]), get(state, operands[1]))
    a, b = (words.signed(get(state, o)) for o in operands[2:])
    low, high = words.halves(words.add(so_far, words.multiply(a, b)))
    put(state, operands[0], low)
    put(state, operands[1], words.named(high))


def _high_sum(state: State, operands: tuple[str, ...]) -> None:
    """Smmla: the addend plus the higher word of a product."""
    words = state.words
    a, b = (words.signed(get(state, o)) for o in operands[1:3])
    high = words.floor(words.multiply(a, b), 32)
    put(state, operands[0], words.named(words.add(get(state, operands[3]), high)))


def _clamp(state: State, operands: tuple[str, ...]) -> None:
    """Ssat."""
    bits = int(operands[1].removeprefix("#"))
    least, most = -(1 << (bits - 1)), (1 << (bits - 1)) - 1
    value = state.words.signed(get(state, operands[2]))
    if decided(state, state.words.less(value, constant(least), signed=True)):
        value = constant(least)
    elif decided(state, state.words.less(constant(most), value, signed=True)):
        value = constant(most)
    put(state, operands[0], value)


def _add_with_carry(state: State, a: Value, b: Value) -> Value:
    """Adc, where the carry is that of a sum."""
    if state.compared is None or state.compared[0] != "sum":
        raise UnprovenError("a carry that the proof does not follow")
    words, (_, *parts) = state.words, state.compared
    return words.add(words.add(a, b), words.carry(words.add(*parts)))


DO: dict[str, Callable[[State, tuple[str, ...]], None]] = {
    "ldr": _load,
    "str": _store,
    "ldrd": _load_two,
    "strd": _store_two,
    "ldmia": _load_many,
    "stmia": _store_many,
    "stmdb": _push,
    "push": _push,
    "pop": _pop,
    "bl": _call,
    "b": _branch,
    "bx": _return,
    "cmp": _compare,
    "smull": _long,
    "smlal": _long_sum,
    "smmla": _high_sum,
    "ssat": _clamp,
    "nop": lambda *_: None,
}
"""Instructions that do more than to form one word."""


COMPUTE: dict[str, Callable[..., Value]] = {
    "mov": lambda _, a: a,
    "movw": lambda _, a: a,
    "add": lambda s, a, b: s.words.add(a, b),
    "adc": _add_with_carry,
    "sub": lambda s, a, b: s.words.subtract(a, b),
    "rsb": lambda s, a, b: s.words.subtract(b, a),
    "neg": lambda s, a: s.words.subtract(constant(0), a),
    "mvn": lambda s, a: s.words.subtract(constant(-1), a),
    "mul": lambda s, a, b: s.words.multiply(a, b),
    "asr": lambda s, a, b: s.words.floor(s.words.signed(a), shift_of(b)),
    "lsr": lambda s, a, b: s.words.floor(s.words.unsigned(a), shift_of(b)),
    "lsl": lambda s, a, b: s.words.shift_left(a, shift_of(b)),
    "uxth": lambda s, a: s.words.low_bits(a, 16),
    "uxtb": lambda s, a: s.words.low_bits(a, 8),
    "and": lambda s, a, b: s.words.masked(a, b),
    "orr": lambda s, a, b: s.words.either(a, b),
}
"""Instructions that form one word."""
OPERANDS = dict.fromkeys(("mov", "movw", "neg", "mvn", "uxth", "uxtb"), 1)
"""How many words one is formed of, where it is not two."""
