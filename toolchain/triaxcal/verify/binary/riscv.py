"""Instructions of RV32IM that the routine is compiled to, as objdump -M no-aliases names them."""

from __future__ import annotations

import re
from collections.abc import Callable

import z3

from triaxcal.verify.binary.listing import Instruction
from triaxcal.verify.binary.machine import State, decided
from triaxcal.verify.binary.values import UnprovenError, Value, Words, constant, shift_of

_ADDRESS = re.compile(r"^(-?\d+)\((\w+)\)$")


class RiscV:
    """The core: what each instruction does to registers and memory."""

    saved: tuple[str, ...] = tuple(f"s{i}" for i in range(12))
    scratch: tuple[str, ...] = (*(f"a{i}" for i in range(8)), *(f"t{i}" for i in range(7)))
    arguments: tuple[str, ...] = ("a0", "a1", "a2", "a3")
    stack = "sp"
    link = "ra"

    def step(self, state: State, instruction: Instruction) -> None:
        """Do one instruction."""
        name, operands = instruction.name, instruction.operands
        words = state.words
        if name in _BRANCHES:
            a, b = (_get(state, o) for o in operands[:2])
            if decided(state, _BRANCHES[name](words, a, b)):
                state.pc = int(operands[2], 16)
        elif name == "lw":
            _put(state, operands[0], state.load(*_address(state, operands[1])))
        elif name == "sw":
            base, offset = _address(state, operands[1])
            state.store(base, _get(state, operands[0]), offset)
        elif name == "jal":
            _put(state, operands[0], constant(state.pc))
            state.pc = int(operands[1], 16)
        elif name == "jalr":
            base, offset = _address(state, operands[1])
            to = words.add(base, constant(offset)).number
            if to is None:
                raise UnprovenError("a jump that depends on the inputs")
            _put(state, operands[0], constant(state.pc))
            state.pc = to
        elif name in _COMPUTE:
            sources = (_source(state, o) for o in operands[1:])
            _put(state, operands[0], words.named(_COMPUTE[name](words, *sources)))
        else:
            raise UnprovenError("an instruction that the proof does not know")


def _get(state: State, name: str) -> Value:
    if name == "zero":
        return constant(0)
    if name not in state.registers:
        raise UnprovenError(f"reads {name}, which holds nothing")
    return state.registers[name]


def _put(state: State, name: str, value: Value) -> None:
    if name != "zero":
        state.registers[name] = value


def _source(state: State, operand: str) -> Value:
    if operand[0].isdigit() or operand[0] == "-":
        return constant(int(operand, 0))
    return _get(state, operand)


def _address(state: State, operand: str) -> tuple[Value, int]:
    found = _ADDRESS.match(operand)
    if found is None:
        raise UnprovenError("a form of address that the proof does not know")
    return _get(state, found[2]), int(found[1])


def _high(words: Words, a: Value, b: Value) -> Value:
    return words.floor(words.multiply(words.signed(a), words.signed(b)), 32)


def _below(words: Words, a: Value, b: Value) -> Value:
    """Sltu: the carry of a sum, where it is compared with one of its parts."""
    if a.parts is None or b.poly not in (part.poly for part in a.parts):
        raise UnprovenError("a comparison that the proof does not follow")
    return words.carry(a)


_BRANCHES: dict[str, Callable[[Words, Value, Value], z3.BoolRef]] = {
    "beq": lambda w, a, b: w.equal(a, b),
    "bne": lambda w, a, b: z3.Not(w.equal(a, b)),
    "blt": lambda w, a, b: w.less(a, b, signed=True),
    "bge": lambda w, a, b: z3.Not(w.less(a, b, signed=True)),
    "bltu": lambda w, a, b: w.less(a, b, signed=False),
    "bgeu": lambda w, a, b: z3.Not(w.less(a, b, signed=False)),
}
_COMPUTE: dict[str, Callable[..., Value]] = {
    "lui": lambda w, a: w.shift_left(a, 12),
    "add": lambda w, a, b: w.add(a, b),
    "addi": lambda w, a, b: w.add(a, b) if b.number else a,
    "sub": lambda w, a, b: w.subtract(a, b),
    "mul": lambda w, a, b: w.multiply(a, b),
    "mulh": _high,
    "and": lambda w, a, b: w.masked(a, b),
    "andi": lambda w, a, b: w.masked(a, b),
    "or": lambda w, a, b: w.either(a, b),
    "slli": lambda w, a, b: w.shift_left(a, shift_of(b)),
    "srli": lambda w, a, b: w.floor(w.unsigned(a), shift_of(b)),
    "srai": lambda w, a, b: w.floor(w.signed(a), shift_of(b)),
    "sltu": _below,
}
