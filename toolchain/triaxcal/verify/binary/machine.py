"""Registers, memory and the ways through a function; what an instruction does, the core says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Protocol

import z3

from triaxcal.verify.binary.listing import Instruction, Listing
from triaxcal.verify.binary.terms import Poly
from triaxcal.verify.binary.values import UnprovenError, Value, Words, constant

RETURN = 0xFFFF_FFFC
"""Where a function returns to: no address of the program."""
STACK = 0x2100_0000
_STACK_SIZE = 0x1000
_STEPS_MAX = 20_000


@dataclass
class State:
    """One way through a function, so far.

    Attributes
    ----------
    words : Words
        With the facts of the branches taken.
    registers : dict of str to Value
    memory : dict of int to Value
        Words by address; nothing else may be read.
    writable : dict of int to str
        Addresses outside of the stack that may be written, and what they are.
    compared : tuple
        What the flags stand for: the core's matter.
    conditions : list of str
        Under which the next instructions are done, where they are bound to one.
    here : int
        Address of the instruction that is done.
    """

    words: Words
    registers: dict[str, Value]
    memory: dict[int, Value]
    writable: Mapping[int, str]
    pc: int = 0
    compared: tuple[str, Value, Value] | None = None
    conditions: list[str] = field(default_factory=list)
    here: int = 0

    def copy(self) -> State:
        """A second way that goes on by itself."""
        return State(
            self.words.copy(), dict(self.registers), dict(self.memory), self.writable, self.pc,
            self.compared, list(self.conditions), self.here,
        )  # fmt: skip

    def load(self, address: Value, offset: int = 0) -> Value:
        """The word there."""
        at = _known(address) + offset
        if at not in self.memory:
            raise UnprovenError(f"reads a word at {at:#x}, which nothing has written")
        return self.memory[at]

    def store(self, address: Value, value: Value, offset: int = 0) -> None:
        """Write a word, where that is allowed."""
        at = _known(address) + offset
        if at % 4:
            raise UnprovenError(f"writes to {at:#x}, which is no multiple of 4")
        if at not in self.writable and not STACK - _STACK_SIZE <= at < STACK:
            raise UnprovenError(f"writes to {at:#x}, outside of the stack and its results")
        self.memory[at] = value


def _known(address: Value) -> int:
    if address.number is None:
        raise UnprovenError("an address that depends on the inputs")
    return address.number


class Core(Protocol):
    """What a kind of processor adds."""

    saved: tuple[str, ...]
    """Registers that a function has to leave as they were."""
    scratch: tuple[str, ...]
    """Registers that hold anything at first and may be left as anything."""
    arguments: tuple[str, ...]
    stack: str
    link: str

    def step(self, state: State, instruction: Instruction) -> None:
        """Do one instruction; a branch sets `state.pc`. Raises `Fork` where both ways are open."""


class Fork(Exception):  # noqa: N818  not an error: two ways go on
    """A branch that depends on the inputs; the instruction is done again on each way."""

    def __init__(self, condition: z3.BoolRef) -> None:
        super().__init__("fork")
        self.condition = condition


def decided(state: State, condition: z3.BoolRef) -> bool:
    """Whether a condition holds on this way.

    Raises
    ------
    Fork
        When it may and may not.
    """
    if state.words.follows(condition):
        return True
    if state.words.follows(z3.Not(condition)):
        return False
    raise Fork(condition)


def ways(
    core: Core, listing: Listing, function: str, start: State, arguments: tuple[Value, ...]
) -> Iterator[State]:
    """Ends of all ways through a function.

    Raises
    ------
    UnprovenError
        When a step cannot be shown to be defined, or a register or the stack is not left in order.
    """
    state = start.copy()
    before = {name: state.words.unknown(f"{name} before") for name in core.saved}
    state.registers.update(before)
    state.registers.update({name: state.words.unknown(f"{name} at first") for name in core.scratch})
    state.registers.update(zip(core.arguments, arguments, strict=False))
    state.registers[core.stack] = constant(STACK)
    state.registers[core.link] = constant(RETURN)
    state.memory |= {at: constant(word) for at, word in listing.words.items()}
    state.pc = listing.functions[function]
    left = [state]
    while left:
        state = left.pop()
        for _ in range(_STEPS_MAX):
            if state.pc == RETURN:
                break
            instruction = listing.at(state.pc)
            tried = state.copy()
            tried.here, tried.pc = state.pc, state.pc + instruction.size
            try:
                core.step(tried, instruction)
            except Fork as fork:
                other = state.copy()
                other.words.path.append(z3.Not(fork.condition))
                state.words.path.append(fork.condition)
                left.append(other)
                continue
            except UnprovenError as error:
                raise UnprovenError(f"{state.pc:#x}, {instruction.text}: {error}") from None
            state = tried
        else:
            raise UnprovenError(f"{function} does not return within {_STEPS_MAX} instructions")
        _refuse_disorder(core, state, before)
        yield state


def _refuse_disorder(core: Core, state: State, before: Mapping[str, Value]) -> None:
    for name, value in before.items():
        if _poly(state, name) != value.poly:
            raise UnprovenError(f"{name} is not left as it was")
    if state.registers[core.stack].number != STACK:
        raise UnprovenError("the stack is not left as it was")


def _poly(state: State, register: str) -> Poly:
    return state.registers[register].poly
