"""Instructions of Thumb-1 and Thumb-2 (ARMv6-M, ARMv7-M) that the routine is compiled to."""

from __future__ import annotations

import re

from triaxcal.verify.binary.listing import Instruction
from triaxcal.verify.binary.machine import State
from triaxcal.verify.binary.thumb_instructions import COMPUTE, DO, OPERANDS
from triaxcal.verify.binary.thumb_operands import holds, put, source, target
from triaxcal.verify.binary.values import UnprovenError, constant

_CONDITIONS = (
    "eq", "ne", "cs", "hs", "cc", "lo", "mi", "pl", "hi", "ls", "ge", "lt", "gt", "le", "al",
)  # fmt: skip
_OPPOSITE = {
    "eq": "ne", "ne": "eq", "cs": "cc", "cc": "cs", "mi": "pl", "pl": "mi", "hi": "ls", "ls": "hi",
    "ge": "lt", "lt": "ge", "gt": "le", "le": "gt",
}  # fmt: skip
_FLAGS = {"sub": "difference", "add": "sum"}
"""What the flags stand for after these; after others, the result alone is known."""
_SHIFT = re.compile(r"^(asr|lsl|lsr) (#\d+)$")
_IT = re.compile(r"^it[te]{0,3}$")


class Thumb:
    """The core: what each instruction does to registers, memory and flags."""

    saved: tuple[str, ...] = ("r4", "r5", "r6", "r7", "r8", "r9", "r10", "r11")
    scratch: tuple[str, ...] = ("r0", "r1", "r2", "r3", "r12")
    arguments: tuple[str, ...] = ("r0", "r1", "r2", "r3")
    stack = "sp"
    link = "lr"

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
            if not holds(state, condition):
                return
            name = name.removesuffix(condition)
        if name[0] == "b" and name[1:] in _CONDITIONS:
            if holds(state, name[1:]):
                state.pc = target(operands[-1])
            return
        do = DO.get(name)
        if do is not None:
            do(state, operands)
            return
        if _SHIFT.match(operands[-1]):
            name, operands = _shifted(name, operands)
        setting = name.endswith("s") and name[:-1] in COMPUTE
        name = name[:-1] if setting else name
        compute = COMPUTE.get(name)
        if compute is None:
            raise UnprovenError("an instruction that the proof does not know")
        operands = operands if len(operands) > OPERANDS.get(name, 2) else (operands[0], *operands)
        sources = tuple(source(state, o) for o in operands[1:])
        result = state.words.named(compute(state, *sources))
        put(state, operands[0], result)
        if setting and not conditional:
            state.compared = "result", result, constant(0)
            if name in _FLAGS:
                state.compared = _FLAGS[name], sources[0], sources[1]


def _shifted(name: str, operands: tuple[str, ...]) -> tuple[str, tuple[str, ...]]:
    """The shift that `mov` with a shifted operand is."""
    shift, by = operands[-1].split()
    if name not in ("mov", "movs"):
        raise UnprovenError("a shifted operand that the proof does not know")
    return shift + name[3:], (*operands[:-1], by)
