"""Mutants of the generated C: every small mistake that a hand or a template could make in it.

Operators: another operator of its kind, a sign or a complement lost, a constant one off, a name
replaced by its neighbour (ux by uy, row by column), a condition negated, a statement lost.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass

from triaxcal.verify.c_tokens import DIRECTIVE, NAME, NUMBER, OPERATOR, Token, tokens_of

REPLACEMENTS = {
    "+": "-", "-": "+", "*": "+", "/": "*", "%": "/",
    "<": "<= >", "<=": "< >=", ">": ">= <", ">=": "> <=", "==": "!=", "!=": "==",
    "<<": ">>", ">>": "<<", "&": "| ^", "|": "& ^", "^": "| &", "&&": "||", "||": "&&",
    "+=": "-= =", "-=": "+=", "*=": "+= =", "^=": "|= =", "|=": "= &=",
}  # fmt: skip
"""Binary operators and what each is replaced by; others of the C grammar do not occur."""

NEIGHBOURS = (
    ("ux", "uy", "uz"), ("x", "y", "z"), ("sum_x", "sum_y", "sum_z"), ("i", "j"), ("i1", "i2"),
    ("p", "q"), ("low", "high"), ("x_low", "x_high"), ("x_low", "y_low", "z_low"),
    ("x_high", "y_high", "z_high"), ("low_low", "low_high", "high_low", "high_high"),
    ("middle", "middle_2"), ("INT32_MIN", "INT32_MAX"), ("below", "above"), ("first", "last"),
    ("temp_min_code", "temp_max_code"), ("rate_min_code", "rate_max_code"),
    ("TRIAX_RAW_MIN", "TRIAX_RAW_MAX"), ("first_code", "origin_code"),
    ("TRIAX_STATUS_TEMP_LOW", "TRIAX_STATUS_TEMP_HIGH"),
)  # fmt: skip
"""Names that a mistake exchanges."""

_TYPES = {"int32_t", "int64_t", "uint32_t", "uint64_t", "uint8_t", "size_t", "const", "static",
          *(f"triax_{triad}{name}_t" for triad in ("", "gyro_")
            for name in ("segment", "calib", "state"))}  # fmt: skip
_FUNCTION = re.compile(r"^(?:[a-z_]\w*[ *]+)+(\w+)\(", re.MULTILINE)
_DEFINE = re.compile(r"#define (\w+) (.*)")


@dataclass(frozen=True)
class Mutant:
    """One change of the source.

    Attributes
    ----------
    function : str
        Function or macro that it lies in.
    line : int
        Counted from 1.
    before, after : str
        The line without and with the change, stripped.
    source : str
        The whole file with the change.
    """

    function: str
    line: int
    before: str
    after: str
    source: str

    def __str__(self) -> str:
        return f"{self.function}, line {self.line}: {self.before}  ->  {self.after}"


def mutants_of(source: str) -> list[Mutant]:
    """Every mutant of a source, in its order, no two alike."""
    tokens = tokens_of(source)
    starts = [(m.start(), m.group(1)) for m in _FUNCTION.finditer(source)]
    mutants = []
    seen = {source}
    for start, end, text in sorted(_changes(source, tokens)):
        changed = source[:start] + text + source[end:]
        if changed in seen:
            continue
        seen.add(changed)
        line = source.count("\n", 0, start)
        # A removed statement may span lines: what is shown is the line that it starts on.
        before, after = source.split("\n")[line].strip(), changed.split("\n")[line].strip()
        define = _DEFINE.match(before)
        name = define.group(1) if define else _enclosing(starts, start)
        mutants.append(Mutant(name, line + 1, before, after, changed))
    return mutants


Change = tuple[int, int, str]
"""Start and end of what is replaced, and by what."""


def _enclosing(starts: list[tuple[int, str]], at: int) -> str:
    return next((name for start, name in reversed(starts) if start <= at), "")


def _changes(source: str, tokens: list[Token]) -> Iterator[Change]:
    yield from _defines(tokens)
    code = [t for t in tokens if t.kind != DIRECTIVE]
    sizes = _array_sizes(code)
    names = _names_around(source, code)
    for at, token in enumerate(code):
        if at in sizes:
            continue
        before = code[at - 1] if at else token
        if token.kind == NUMBER:
            yield from _off_by_one(token)
        elif token.kind == NAME:
            yield from _neighbours(token, names[at])
        elif token.kind == OPERATOR:
            yield from _operators(code, at, before)
    yield from _indices(source, code, sizes)
    yield from _negations(source, code)
    yield from _lost_statements(code)


def _off_by_one(token: Token) -> Iterator[Change]:
    digits = token.text.rstrip("uUlL")
    suffix = token.text[len(digits) :]
    for value in (int(digits, 0) + 1, int(digits, 0) - 1):
        if value >= 0:
            yield token.start, token.end, f"{value}{suffix}"


def _defines(tokens: list[Token]) -> Iterator[Change]:
    """Numbers in #define; the rest of the directives is no arithmetic."""
    for token in tokens:
        define = _DEFINE.match(token.text) if token.kind == DIRECTIVE else None
        if define is None:
            continue
        body = define.group(2).split("/*")[0]
        shift = token.start + define.start(2)
        for inner in tokens_of(body):
            if inner.kind == NUMBER:
                yield from _off_by_one(Token(NUMBER, inner.text, inner.start + shift))


def _neighbours(token: Token, names: set[str]) -> Iterator[Change]:
    for family in NEIGHBOURS:
        if token.text in family:
            for other in family:
                if other != token.text and (other in names or other.isupper()):
                    yield token.start, token.end, other


def _names_around(source: str, code: list[Token]) -> list[set[str]]:
    """For each token the names that occur in its function: others are unknown to the compiler."""
    starts = [m.start() for m in _FUNCTION.finditer(source)]
    groups: dict[int, set[str]] = {}
    places = [bisect_right(starts, token.start) for token in code]
    for token, place in zip(code, places, strict=True):
        if token.kind == NAME:
            groups.setdefault(place, set()).add(token.text)
    return [groups.get(place, set()) for place in places]


def _array_sizes(code: list[Token]) -> set[int]:
    """Tokens of sizes in declarations of arrays: a larger size changes nothing."""
    found: set[int] = set()
    for at, token in enumerate(code):
        if token.kind != NAME or not at or code[at - 1].text not in _TYPES:
            continue
        opening = at + 1
        while opening < len(code) and code[opening].text == "[":
            closing = _matching(code, opening, "]", "[", 1)
            found.update(range(opening, closing + 1))
            opening = closing + 1
    return found


def _operators(code: list[Token], at: int, before: Token) -> Iterator[Change]:
    token = code[at]
    operand = before.kind in (NUMBER, NAME) or before.text in (")", "]")
    cast = before.text == ")" and code[at - 2].text in _TYPES
    operand = operand and not cast and before.text not in ("return", *_TYPES)
    if not operand and token.text in ("-", "~"):
        yield token.start, token.end, ""
    elif operand and token.text in REPLACEMENTS and not _is_pointer(code, at):
        for other in REPLACEMENTS[token.text].split():
            yield token.start, token.end, other


def _is_pointer(code: list[Token], at: int) -> bool:
    """Whether a * belongs to a declaration."""
    return code[at].text == "*" and code[at - 1].text in _TYPES


def _indices(source: str, code: list[Token], sizes: set[int]) -> Iterator[Change]:
    """a[i][j] to a[j][i]."""
    for at, token in enumerate(code):
        if at in sizes or token.text != "]" or at + 1 >= len(code) or code[at + 1].text != "[":
            continue
        start = _matching(code, at, "[", "]", -1)
        end = _matching(code, at + 1, "]", "[", 1)
        first = source[code[start].end : token.start]
        second = source[code[at + 1].end : code[end].start]
        if first != second:
            yield code[start].start, code[end].end, f"[{second}][{first}]"


def _matching(code: list[Token], at: int, close: str, opening: str, step: int) -> int:
    depth = 0
    while True:
        depth += (code[at].text == opening) - (code[at].text == close)
        if depth == 0:
            return at
        at += step


def _negations(source: str, code: list[Token]) -> Iterator[Change]:
    """if (c) to if (!(c)), and c ? a : b to !(c) ? a : b where c is in parentheses."""
    for at, token in enumerate(code):
        if token.text == "if":
            end = _matching(code, at + 1, ")", "(", 1)
            condition = source[code[at + 1].start : code[end].end]
            yield code[at + 1].start, code[end].end, f"(!{condition})"
        elif token.text == "?" and code[at - 1].text == ")":
            start = _matching(code, at - 1, "(", ")", -1)
            yield code[start].start, code[start].end, "!("


def _lost_statements(code: list[Token]) -> Iterator[Change]:
    """Expression statements in function bodies, but for counters of loops: those never end."""
    depth = 0
    parentheses = 0
    start = 0
    for at, token in enumerate(code):
        depth += (token.text == "{") - (token.text == "}")
        parentheses += (token.text == "(") - (token.text == ")")
        if token.text in ("{", "}"):
            start = at + 1
        elif token.text == ";" and parentheses == 0:
            words = code[start:at]
            if depth and words and _is_expression(words):
                yield words[0].start, words[-1].end, ""
            start = at + 1


def _is_expression(words: list[Token]) -> bool:
    text = words[0].text
    return words[0].kind == NAME and text not in (*_TYPES, "return", "for", "if", "else")
