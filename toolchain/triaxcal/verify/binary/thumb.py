"""Instructions of Thumb-1 and Thumb-2 (ARMv6-M, ARMv7-M) that the routine is compiled to."""

from __future__ import annotations

import re
from collections.abc import Callable

import z3

from triaxcal.verify.binary.listing import Instruction, Listing
from triaxcal.verify.binary.machine import State, decided
from triaxcal.verify.binary.values import UnprovenError, Value, constant

_NAMES = {"sb": "r9", "sl": "r10", "fp": "r11", "ip": "r12"}
_CONDITIONS = (
    "eq", "ne", "cs", "hs", "cc", "lo", "mi", "pl", "hi", "ls", "ge", "lt", "gt", "le", "al",
)  # fmt: skip
_OPPOSITE = {
    "eq": "ne", "ne": "eq", "cs": "cc", "cc": "cs", "mi": "pl", "pl": "mi", "hi": "ls", "ls": "hi",
    "ge": "lt", "lt": "ge", "gt": "le", "le": "gt",
}  # fmt: skip
_ADDRESS = re.compile(r"^\[(\w+)(?:, #(-?\d+))?\](!)?$")
_SUM = re.compile(r"^\[(\w+), (\w+)\]$")
_SHIFT = re.compile(r"^(asr|lsl|lsr) (#\d+)$")
_IT = re.compile(r"^it[te]{0,3}$")


class Thumb:
    """The core: what each instruction does to registers, memory and flags."""

    saved = ("r4", "r5", "r6", "r7", "r8", "r9", "r10", "r11")
    scratch = ("r0", "r1", "r2", "r3", "r12")
    arguments = ("r0", "r1", "r2", "r3")
    stack = "sp"
    link = "lr"

    def __init__(self, listing: Listing) -> None:
        self._listing = listing

    def step(self, state: State, instruction: Instruction) -> None:
        """Do one instruction."""
        name, operands = instruction.name, instruction.operands
        if _IT.match(name):
            state.conditions = [
                operands[0] if sign == "t" else _OPPOSITE[operands[0]] for sign in name[1:]
            ]
            return
        conditional = bool(state.conditions)
        if conditional:
            condition = state.conditions.pop(0)
            if not _holds(state, condition):
                return
            name = name.removesuffix(condition)
        if name[0] == "b" and name[1:] in _CONDITIONS:
            if _holds(state, name[1:]):
                state.pc = _target(operands[-1])
            return
        do = _DO.get(name)
        if do is not None:
            do(self, state, operands)
            return
        if _SHIFT.match(operands[-1]):
            name, operands = _shifted(name, operands)
        setting = name.endswith("s") and name[:-1] in _COMPUTE
        compute = _COMPUTE.get(name[:-1] if setting else name)
        if compute is None:
            raise UnprovenError("an instruction that the proof does not know")
        operands = operands if len(operands) > _ARITY[compute] else (operands[0], *operands)
        sources = tuple(self._source(state, o) for o in operands[1:])
        result = state.words.named(compute(state, *sources))
        _put(state, operands[0], result)
        if setting and not conditional:
            state.compared = (
                ("difference", *sources[:2]) if name == "subs" else ("result", result, constant(0))
            )

    def _source(self, state: State, operand: str) -> Value:
        if operand.startswith("#"):
            return constant(int(operand[1:], 0))
        return _get(state, operand)

    def load(self, state: State, operands: tuple[str, ...]) -> None:
        """Ldr, of memory or of the program's own words."""
        found = _ADDRESS.match(operands[1])
        if found and found[1] == "pc":
            at = ((state.here + 4) & ~3) + int(found[2] or 0)
            if at not in self._listing.words:
                raise UnprovenError(f"reads the program at {at:#x}")
            _put(state, operands[0], constant(self._listing.words[at]))
            return
        base, offset, after = _address(state, operands)
        _put(state, operands[0], state.load(base, offset))
        if after:
            _move(state, *after)


def _shifted(name: str, operands: tuple[str, ...]) -> tuple[str, tuple[str, ...]]:
    """The shift that `mov` with a shifted operand is."""
    shift, by = operands[-1].split()
    if name not in ("mov", "movs"):
        raise UnprovenError("a shifted operand that the proof does not know")
    return shift + name[3:], (*operands[:-1], by)


def _register(name: str) -> str:
    return _NAMES.get(name, name)


def _get(state: State, name: str) -> Value:
    register = _register(name)
    if register not in state.registers:
        raise UnprovenError(f"reads {register}, which holds nothing")
    return state.registers[register]


def _put(state: State, name: str, value: Value) -> None:
    register = _register(name)
    if register == "pc":
        state.pc = _jump(value)
    else:
        state.registers[register] = value


def _jump(value: Value) -> int:
    if value.number is None:
        raise UnprovenError("a jump that depends on the inputs")
    return value.number & ~1


def _target(operand: str) -> int:
    return int(operand.split()[0], 16)


def _address(
    state: State, operands: tuple[str, ...]
) -> tuple[Value, int, tuple[str, int] | None]:
    """Base, offset, and what is added to which register afterwards."""
    if two := _SUM.match(operands[-1]):
        return state.words.add(_get(state, two[1]), _get(state, two[2])), 0, None
    found = _ADDRESS.match(operands[-1] if operands[-1].startswith("[") else operands[-2])
    if found is None:
        raise UnprovenError("a form of address that the proof does not know")
    base, offset = _get(state, found[1]), int(found[2] or 0)
    if found[3]:
        return base, offset, (found[1], offset)
    if not operands[-1].startswith("["):
        return base, 0, (found[1], int(operands[-1].removeprefix("#")))
    return base, offset, None


def _move(state: State, register: str, by: int) -> None:
    _put(state, register, state.words.add(_get(state, register), constant(by)))


def _list(operand: str) -> list[str]:
    return [name.strip() for name in operand.strip("{}").split(",")]


def _holds(state: State, condition: str) -> bool:
    """Whether a condition of the flags holds."""
    if state.compared is None:
        raise UnprovenError("flags that nothing has set")
    kind, a, b = state.compared
    words = state.words
    if kind == "result" and condition not in ("eq", "ne", "mi", "pl"):
        raise UnprovenError("flags that the proof does not follow")
    formulas: dict[str, Callable[[], z3.BoolRef]] = {
        "eq": lambda: words.equal(a, b),
        "ne": lambda: z3.Not(words.equal(a, b)),
        "lt": lambda: words.less(a, b, signed=True),
        "ge": lambda: z3.Not(words.less(a, b, signed=True)),
        "gt": lambda: words.less(b, a, signed=True),
        "le": lambda: z3.Not(words.less(b, a, signed=True)),
        "cc": lambda: words.less(a, b, signed=False),
        "cs": lambda: z3.Not(words.less(a, b, signed=False)),
        "hi": lambda: words.less(b, a, signed=False),
        "ls": lambda: z3.Not(words.less(b, a, signed=False)),
        "mi": lambda: words.less(a, constant(0), signed=True),
        "pl": lambda: z3.Not(words.less(a, constant(0), signed=True)),
    }
    formulas |= {"lo": formulas["cc"], "hs": formulas["cs"]}
    if kind == "difference" and condition in ("mi", "pl"):
        a = words.subtract(a, b)
    return decided(state, formulas[condition]())


def _compare(core: Thumb, state: State, operands: tuple[str, ...]) -> None:
    state.compared = (
        "difference",
        _get(state, operands[0]),
        core._source(state, operands[1]),
    )


def _store(core: Thumb, state: State, operands: tuple[str, ...]) -> None:
    base, offset, after = _address(state, operands)
    state.store(base, _get(state, operands[0]), offset)
    if after:
        _move(state, *after)


def _load_two(core: Thumb, state: State, operands: tuple[str, ...]) -> None:
    base, offset, _ = _address(state, operands)
    first, second = state.load(base, offset), state.load(base, offset + 4)
    _put(state, operands[0], first)
    _put(state, operands[1], second)


def _store_two(core: Thumb, state: State, operands: tuple[str, ...]) -> None:
    base, offset, _ = _address(state, operands)
    state.store(base, _get(state, operands[0]), offset)
    state.store(base, _get(state, operands[1]), offset + 4)


def _load_many(core: Thumb, state: State, operands: tuple[str, ...]) -> None:
    base, moves = operands[0].removesuffix("!"), operands[0].endswith("!")
    names = _list(operands[1])
    at = _get(state, base)
    values = [state.load(at, 4 * i) for i in range(len(names))]
    if moves:
        _move(state, base, 4 * len(names))
    for name, value in zip(names, values, strict=True):
        _put(state, name, value)


def _store_many(core: Thumb, state: State, operands: tuple[str, ...]) -> None:
    base, moves = operands[0].removesuffix("!"), operands[0].endswith("!")
    names = _list(operands[1])
    at = _get(state, base)
    for i, name in enumerate(names):
        state.store(at, _get(state, name), 4 * i)
    if moves:
        _move(state, base, 4 * len(names))


def _push(core: Thumb, state: State, operands: tuple[str, ...]) -> None:
    if operands[:-1] not in ((), ("sp!",)):
        raise UnprovenError("a form of address that the proof does not know")
    names = _list(operands[-1])
    _move(state, "sp", -4 * len(names))
    for i, name in enumerate(names):
        state.store(_get(state, "sp"), _get(state, name), 4 * i)


def _pop(core: Thumb, state: State, operands: tuple[str, ...]) -> None:
    _load_many(core, state, ("sp!", operands[-1]))


def _call(core: Thumb, state: State, operands: tuple[str, ...]) -> None:
    state.registers["lr"] = constant(state.pc | 1)
    state.pc = _target(operands[0])


def _branch(core: Thumb, state: State, operands: tuple[str, ...]) -> None:
    state.pc = _target(operands[0])


def _return(core: Thumb, state: State, operands: tuple[str, ...]) -> None:
    state.pc = _jump(_get(state, operands[0]))


def _long(core: Thumb, state: State, operands: tuple[str, ...]) -> None:
    """Smull."""
    words = state.words
    a, b = (words.signed(_get(state, o)) for o in operands[2:])
    low, high = words.halves(words.multiply(a, b))
    _put(state, operands[0], low)
    _put(state, operands[1], words.named(high))


def _long_sum(core: Thumb, state: State, operands: tuple[str, ...]) -> None:
    """Smlal."""
    words = state.words
    so_far = words.wide(_get(state, operands[0]), _get(state, operands[1]))
    a, b = (words.signed(_get(state, o)) for o in operands[2:])
    low, high = words.halves(words.add(so_far, words.multiply(a, b)))
    _put(state, operands[0], low)
    _put(state, operands[1], words.named(high))


def _high_sum(core: Thumb, state: State, operands: tuple[str, ...]) -> None:
    """Smmla: the addend plus the higher word of a product."""
    words = state.words
    a, b = (words.signed(_get(state, o)) for o in operands[1:3])
    high = words.floor(words.multiply(a, b), 32)
    _put(state, operands[0], words.named(words.add(_get(state, operands[3]), high)))


def _clamp(core: Thumb, state: State, operands: tuple[str, ...]) -> None:
    """Ssat."""
    bits = int(operands[1].removeprefix("#"))
    least, most = -(1 << (bits - 1)), (1 << (bits - 1)) - 1
    value = state.words.signed(_get(state, operands[2]))
    if decided(state, state.words.less(value, constant(least), signed=True)):
        value = constant(least)
    elif decided(state, state.words.less(constant(most), value, signed=True)):
        value = constant(most)
    _put(state, operands[0], value)


def _nothing(core: Thumb, state: State, operands: tuple[str, ...]) -> None:
    return


_DO: dict[str, Callable[[Thumb, State, tuple[str, ...]], None]] = {
    "ldr": Thumb.load,
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
    "nop": _nothing,
}
"""Instructions that do more than to form one word."""


def _shift(state: State, a: Value, b: Value) -> int:
    if b.number is None or not 0 <= b.number < 32:
        raise UnprovenError("a shift that depends on the inputs")
    return b.number


_COMPUTE: dict[str, Callable[..., Value]] = {
    "mov": lambda s, a: a,
    "movw": lambda s, a: a,
    "add": lambda s, a, b: s.words.add(a, b),
    "sub": lambda s, a, b: s.words.subtract(a, b),
    "rsb": lambda s, a, b: s.words.subtract(b, a),
    "neg": lambda s, a: s.words.subtract(constant(0), a),
    "mvn": lambda s, a: s.words.subtract(constant(-1), a),
    "mul": lambda s, a, b: s.words.multiply(a, b),
    "asr": lambda s, a, b: s.words.floor(s.words.signed(a), _shift(s, a, b)),
    "lsr": lambda s, a, b: s.words.floor(s.words.unsigned(a), _shift(s, a, b)),
    "lsl": lambda s, a, b: s.words.shift_left(a, _shift(s, a, b)),
    "uxth": lambda s, a: s.words.low_bits(a, 16),
    "uxtb": lambda s, a: s.words.low_bits(a, 8),
    "and": lambda s, a, b: s.words.masked(a, b),
    "orr": lambda s, a, b: s.words.either(a, b),
}
"""Instructions that form one word."""
_ARITY = {f: 1 for n, f in _COMPUTE.items() if n in ("mov", "movw", "neg", "mvn", "uxth", "uxtb")}
_ARITY |= {f: 2 for f in _COMPUTE.values() if f not in _ARITY}
