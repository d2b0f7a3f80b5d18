"""Runs the definitions of an ACSL text: logic functions and predicates become Python functions.

A reading of its own, from the ACSL manual: it knows nothing of the C and of the provers. Lemmas are
read and dropped, as they define nothing. Memory does not change here, so labels name one state.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

_TOKEN = re.compile(
    r"\s+|//[^\n]*|(0[xX][0-9A-Fa-f]+|\d+|\\?[A-Za-z_]\w*|<==>|==>|->|<<|>>|[<>=!]=|&&|\|\||[-+*/%<>&^|!?:;,.(){}\[\]=])"
)
_COMPARED = ("<", "<=", ">", ">=", "==", "!=")
_SHIFT = 4
_BINARY = (("|",), ("^",), ("&",), _COMPARED, ("<<", ">>"), ("+", "-"), ("*", "/", "%"))
"""Operators from the weakest. `/` and `%` of ACSL round towards zero, the others are Python's."""
_LOGICAL = (
    ("<==>", "({} == {})"), ("==>", "(not {} or {})"), ("||", "({} or {})"), ("&&", "({} and {})"),
)  # fmt: skip


@dataclass(frozen=True)
class Pointer:
    """An element of an array; element 0 of one of its own for the address of a structure."""

    array: Sequence[Any]
    at: int = 0

    def __getitem__(self, index: int) -> Any:
        if not 0 <= self.at + index < len(self.array):
            raise IndexError(f"element {self.at + index} of {len(self.array)}")
        return self.array[self.at + index]


def quotient(a: int, b: int) -> int:
    """a / b towards zero."""
    return abs(a) // abs(b) * (1 if (a < 0) == (b < 0) else -1)


def definitions(text: str, macros: dict[str, int]) -> dict[str, Callable[..., Any]]:
    """The defined functions of ACSL comments by name; `macros` are the names of the C.

    Raises
    ------
    ValueError
        Where the text is not understood.
    """
    limits = {"INT32_MIN": -(2**31), "INT32_MAX": 2**31 - 1}
    known: dict[str, Any] = {**macros, **limits, "quotient": quotient, "Pointer": Pointer}
    for comment in re.findall(r"/\*@(.*?)\*/", text, re.DOTALL):
        for source in _Reader(comment).functions():
            exec(source, known)
    return {name: f for name, f in known.items() if callable(f) and not name.startswith("__")}


class _Reader:
    def __init__(self, text: str) -> None:
        self.tokens: list[str] = []
        at = 0
        while at < len(text):
            found = _TOKEN.match(text, at)
            if found is None:
                raise ValueError(f"not a token: {text[at : at + 30]!r}")
            self.tokens += [found[1]] if found[1] else []
            at = found.end()
        self.at = 0

    def next(self) -> str:
        return self.tokens[self.at] if self.at < len(self.tokens) else ""

    def take(self, expected: str = "") -> str:
        token = self.next()
        if not token or (expected and token != expected):
            before = " ".join(self.tokens[max(0, self.at - 12) : self.at])
            raise ValueError(f"{token!r} for {expected!r} after {before}")
        self.at += 1
        return token

    def taken(self, token: str) -> bool:
        if self.next() != token:
            return False
        self.at += 1
        return True

    def functions(self) -> list[str]:
        """Python text of each definition."""
        found = []
        while self.next():
            if self.taken("axiomatic"):
                self.take()
                self.take("{")
            elif self.taken("}"):
                continue
            else:
                kind = self.take()
                if kind == "lemma":
                    self._pass_lemma()
                elif kind in ("logic", "predicate"):
                    found += self._definition(typed=kind == "logic")
                else:
                    raise ValueError(f"not a definition: {kind}")
        return found

    def _pass_lemma(self) -> None:
        """Over a lemma: each of its quantifiers has a semicolon, and so has its end."""
        left = 1
        while left:
            token = self.take()
            left += {"\\forall": 1, "\\exists": 1, ";": -1}.get(token, 0)

    def _definition(self, *, typed: bool) -> list[str]:
        """Python text of a logic function or predicate; nothing where it is only declared."""
        name = self._name(typed=typed)
        parameters = self._parameters() if self.taken("(") else []
        found = []
        if self.taken("="):
            found = [f"def {name}({', '.join(parameters)}): return {self.expression()}"]
        self.take(";")
        return found

    def _name(self, *, typed: bool) -> str:
        """A declared name; a type before it and labels behind it are passed over."""
        if typed:
            self.take()
        while self.taken("*"):
            pass
        name = self.take()
        self._labels()
        return name

    def _labels(self) -> None:
        if self.taken("{"):
            while not self.taken("}"):
                self.take()

    def _parameters(self) -> list[str]:
        """Names of parameters: the last name of each, or the one in brackets."""
        names, depth, last = [], 1, ""
        while depth:
            token = self.take()
            if token == "[":  # the length of an array's rows
                while not self.taken("]"):
                    self.take()
            elif re.match(r"[A-Za-z_]", token):
                last = token
            depth += {"(": 1, ")": -1}.get(token, 0)
            if token == "," or not depth:
                names.append(last)
        return names

    def expression(self) -> str:
        if self.taken("\\forall"):
            return self._forall()
        condition = self._logical(0)
        if not self.taken("?"):
            return condition
        then = self.expression()
        self.take(":")
        return f"({then} if {condition} else {self.expression()})"

    def _forall(self) -> str:
        """Over one integer between limits, as in 0 <= k < n ==> body."""
        while self.take() != ";":
            pass
        low, first, name, second, high = (
            self._binary(_SHIFT), self.take("<="), self.take(), self.take(), self._binary(_SHIFT),
        )  # fmt: skip
        if second not in ("<", "<="):
            raise ValueError(f"\\forall without limits, at {low} {first} {name} {second}")
        self.take("==>")
        end = high if second == "<" else f"{high} + 1"
        return f"all({self.expression()} for {name} in range({low}, {end}))"

    def _logical(self, level: int) -> str:
        if level == len(_LOGICAL):
            return self._binary(0)
        token, form = _LOGICAL[level]
        left = self._logical(level + 1)
        while self.taken(token):
            if self.next() == "\\forall":
                right = self.expression()
            else:
                right = self._logical(level if token == "==>" else level + 1)
            left = form.format(left, right)
        return left

    def _binary(self, level: int) -> str:
        if level == len(_BINARY):
            return self._unary()
        left = self._binary(level + 1)
        last = left
        while self.next() in _BINARY[level]:
            token = self.take()
            right = self._binary(level + 1)
            if token in _COMPARED and left is not last:
                left = f"({left} and ({last} {token} {right}))"
            elif token in "/%":
                whole = f"quotient({left}, {right})"
                left = whole if token == "/" else f"({left} - {right} * {whole})"
            else:
                left = f"({left} {token} {right})"
            last = right if token in _COMPARED else left
        return left

    def _unary(self) -> str:
        if self.taken("-"):
            return f"(-{self._unary()})"
        if self.taken("!"):
            return f"(not {self._unary()})"
        if self.taken("&"):
            return self._address(self._unary())
        return self._postfix()

    @staticmethod
    def _address(place: str) -> str:
        """Of an element the array and its index; of a structure's array itself."""
        depth = 0
        for at in range(len(place) - 1, -1, -1):
            depth += {"]": 1, "[": -1}.get(place[at], 0)
            if not depth:
                return f"Pointer({place[:at]}, {place[at + 1 : -1]})"
        raise ValueError(f"address of {place}")

    def _postfix(self) -> str:
        token = self.take()
        if token == "(":
            made = self.expression()
            self.take(")")
        elif token == "\\at":
            self.take("(")
            made = self.expression()
            self.take(",")
            self.take()
            self.take(")")
        elif token[0].isalnum() or token[0] == "_":
            made = token
            if self.next() == "{":
                self._labels()
            if self.taken("("):
                made += f"({', '.join(self._arguments())})"
        else:
            raise ValueError(f"not understood: {token}")
        while self.next() in ("->", "[", "."):
            token = self.take()
            if token == "[":
                made += f"[{self.expression()}]"
                self.take("]")
            else:
                made += f"{'[0]' if token == '->' else ''}.{self.take()}"
        return made

    def _arguments(self) -> list[str]:
        made: list[str] = []
        while not self.taken(")"):
            made.append(self.expression())
            if self.next() != ")":
                self.take(",")
        return made
