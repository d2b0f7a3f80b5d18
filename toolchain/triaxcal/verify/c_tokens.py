"""Tokens of the generated C, enough of them to make mutants: no parser, no preprocessor."""

from __future__ import annotations

import re
from dataclasses import dataclass

NUMBER, NAME, OPERATOR, DIRECTIVE = "number", "name", "operator", "directive"

_TOKEN = re.compile(
    r"""
    (?P<skip>\s+|/\*.*?\*/|//[^\n]*)
  | (?P<directive>^\#[^\n]*(?:\\\n[^\n]*)*)
  | (?P<string>"[^"\n]*")
  | (?P<number>0[xX][0-9A-Fa-f]+[uUlL]*|\d+[uUlL]*)
  | (?P<name>[A-Za-z_]\w*)
  | (?P<operator><<=|>>=|->|\+\+|--|<<|>>|<=|>=|==|!=|&&|\|\||[-+*/%&|^]=
                |[-+*/%&|^~!<>=?:;,.(){}\[\]])
    """,
    re.VERBOSE | re.DOTALL | re.MULTILINE,
)


@dataclass(frozen=True)
class Token:
    """A token and where its text lies in the source."""

    kind: str
    text: str
    start: int

    @property
    def end(self) -> int:
        """Where the text ends."""
        return self.start + len(self.text)


def tokens_of(source: str) -> list[Token]:
    """Tokens in order; comments and spaces are left out, directives are one token each.

    Raises
    ------
    ValueError
        At a character that no token of the generated C starts with.
    """
    tokens = []
    at = 0
    while at < len(source):
        match = _TOKEN.match(source, at)
        if match is None:
            raise ValueError(f"no token of the generated C starts with {source[at : at + 20]!r}")
        kind = match.lastgroup
        if kind != "skip":
            tokens.append(Token(str(kind), match.group(), at))
        at = match.end()
    return tokens
