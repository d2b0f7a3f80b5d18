"""A disassembly by objdump: instructions and words by address."""

from __future__ import annotations

import re
from dataclasses import dataclass

_FUNCTION = re.compile(r"^([0-9a-f]{8}) <([^>]+)>:$")
_LINE = re.compile(r"^\s*([0-9a-f]+):\t([0-9a-f ]+?)\s*\t(\S+)(?:\t(.*))?$")
_COMMENT = re.compile(r"\s*[@#] .*$|\s+<[^>]*>$")


@dataclass(frozen=True)
class Instruction:
    """One line of a disassembly.

    Attributes
    ----------
    address, size : int
        In bytes.
    name : str
        Mnemonic without ".n" and ".w".
    operands : tuple of str
        As written; a list in braces or an address in brackets is one.
    """

    address: int
    size: int
    name: str
    operands: tuple[str, ...]

    @property
    def text(self) -> str:
        """As a line to read."""
        return f"{self.name} {', '.join(self.operands)}".strip()


class Listing:
    """Instructions, words among them, and functions of a program."""

    def __init__(self, text: str) -> None:
        self.functions: dict[str, int] = {}
        self.words: dict[int, int] = {}
        self._at: dict[int, Instruction] = {}
        for line in text.splitlines():
            if found := _FUNCTION.match(line):
                self.functions[found[2]] = int(found[1], 16)
            elif found := _LINE.match(line):
                self._take(int(found[1], 16), found[2], found[3], found[4] or "")

    def _take(self, address: int, code: str, name: str, rest: str) -> None:
        if name == ".word":
            self.words[address] = int(rest.split(maxsplit=1)[0], 16)
            return
        size = len(code.replace(" ", "")) // 2
        operands = _operands(_COMMENT.sub("", _COMMENT.sub("", rest)))
        plain = name.removesuffix(".n").removesuffix(".w")
        self._at[address] = Instruction(address, size, plain, operands)

    def at(self, address: int) -> Instruction:
        """The instruction at an address."""
        return self._at[address]

    def replace(self, instruction: Instruction) -> None:
        """Put another instruction in the place of one."""
        self._at[instruction.address] = instruction

    def of(self, function: str) -> list[Instruction]:
        """Instructions of a function in the order of addresses."""
        start = self.functions[function]
        end = min((a for a in self.functions.values() if a > start), default=1 << 32)
        return [self._at[a] for a in sorted(self._at) if start <= a < end]


def _operands(text: str) -> tuple[str, ...]:
    parts, depth, current = [], 0, ""
    for sign in text.strip():
        depth += (sign in "[{(") - (sign in "]})")
        if sign == "," and depth == 0:
            parts.append(current.strip())
            current = ""
        else:
            current += sign
    return tuple(p for p in (*parts, current.strip()) if p)
