"""Registers, addresses and flags of Thumb, as objdump writes operands."""

from __future__ import annotations

import re
from collections.abc import Callable

import z3

from triaxcal.verify.binary.machine import State, decided
from triaxcal.verify.binary.values import UnprovenError, Value, constant

_NAMES = {"sb": "r9", "sl": "r10", "fp": "r11", "ip": "r12"}
_ADDRESS = re.compile(r"^\[(\w+)(?:, #(-?\d+))?\](!)?$")
_SUM = re.compile(r"^\[(\w+), (\w+)\]$")


def _register(name: str) -> str:
    return _NAMES.get(name, name)


def get(state: State, name: str) -> Value:
    """What a register holds."""
    register = _register(name)
    if register not in state.registers:
        raise UnprovenError(f"reads {register}, which holds nothing")
    return state.registers[register]


def put(state: State, name: str, value: Value) -> None:
    """Have a register hold a word; in pc it is a jump."""
    register = _register(name)
    if register == "pc":
        state.pc = jump(value)
    else:
        state.registers[register] = value


def jump(value: Value) -> int:
    """The address that a register names."""
    if value.number is None:
        raise UnprovenError("a jump that depends on the inputs")
    return value.number & ~1


def target(operand: str) -> int:
    """The address that a branch names."""
    return int(operand.split(maxsplit=1)[0], 16)


def address(state: State, operands: tuple[str, ...]) -> tuple[Value, int, tuple[str, int] | None]:
    """Base, offset, and what is added to which register afterwards."""
    if two := _SUM.match(operands[-1]):
        return state.words.add(get(state, two[1]), get(state, two[2])), 0, None
    found = _ADDRESS.match(operands[-1] if operands[-1].startswith("[") else operands[-2])
    if found is None:
        raise UnprovenError("a form of address that the proof does not know")
    if found[1] == "pc":
        return constant((state.here + 4) & ~3), int(found[2] or 0), None
    base, offset = get(state, found[1]), int(found[2] or 0)
    if found[3]:
        return base, offset, (found[1], offset)
    if not operands[-1].startswith("["):
        return base, 0, (found[1], int(operands[-1].removeprefix("#")))
    return base, offset, None


def move(state: State, register: str, by: int) -> None:
    """Add a number to a register."""
    put(state, register, state.words.add(get(state, register), constant(by)))


def listed(operand: str) -> list[str]:
    """Registers of a list in braces."""
    return [name.strip() for name in operand.strip("{}").split(",")]


def source(state: State, operand: str) -> Value:
    """What an operand stands for: a number or a register."""
    return constant(int(operand[1:], 0)) if operand.startswith("#") else get(state, operand)


def holds(state: State, condition: str) -> bool:
    """Whether a condition of the flags holds."""
    if state.compared is None:
        raise UnprovenError("flags that nothing has set")
    kind, a, b = state.compared
    words = state.words
    if kind == "sum":
        a, b = words.add(a, b), constant(0)
    if kind in ("result", "sum") and condition not in ("eq", "ne", "mi", "pl"):
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
