"""What Frama-C would pass over in silence: what it takes without a proof, or makes no goal of.

`overlooked` looks at the texts before a run, `without_goal` at the goals behind it, and
`unexpected_warning` at what Frama-C says meanwhile.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from itertools import takewhile

_COMMENT = re.compile(r"//[^\n]*|/\*(?!@).*?\*/", re.DOTALL)
_TAKEN = re.compile(r"//@|\b(?:admit|axiom)\b")
_STRUCTURES = re.compile(r"[!=]= *(?:\\(?:old|at)\( *)?\*\w|[(,&|>] *\*\w+ *[!=]=")
"""A comparison of structures, of which Frama-C 25 sees the first element of each array only."""
_STATEMENT = re.compile(
    r"\b(lemma|logic|predicate)\b(.*?)(?=\b(?:lemma|logic|predicate|axiomatic)\b|[}]?\s*\*/|;\s*[}])",
    re.DOTALL,
)
_NAME = re.compile(r"(\w+)(?:\{[\w,]+\})?(?: ?\(|:)")
_FUNCTION = re.compile(
    r"^((?:/\*@(?:[^*]|\*(?!/))*\*/\n)?)(?!typedef)[A-Za-z_][^\n;=(){}]*?(\w+)\([^;{}]*\)\n\{",
    re.MULTILINE,
)
_WARNING = re.compile(r"Warning:\s*([^\n]*(?:\n[^\n\[]*)?)")
_EXPECTED = (
    "Memory model hypotheses for function 'image_fits':",
    "Failed smoke-test",
)
"""Warnings that the documentation names, and those that the goals say again."""
_OF_OTHERS = "No 'assigns' specification for function"
"""A warning of a function that has no contract; the lemmas do not need one."""


def statements_of(text: str) -> dict[str, str]:
    """Lemmas, logic functions and predicates of a specification by name."""
    found = {}
    for kind, rest in _STATEMENT.findall(_COMMENT.sub("", text)):
        statement = " ".join(rest.split()).rstrip(";")
        name = _NAME.search(statement)
        if name is None:
            raise ValueError(f"{kind} without a name: {statement[:60]}")
        found[name[1]] = f"{kind} {statement}"
    return found


def contracts_of(text: str, triad: str) -> dict[str, str]:
    """Contract of each function of the C, "" where it has none; names without the triad's."""
    return {name.removeprefix(f"{triad}_"): head for head, name in _FUNCTION.findall(text)}


def overlooked(
    routine: str, triad: str, definitions: str, opaque: str, *, loader: bool
) -> list[str]:
    """What a run would not prove although its answer says so.

    Parameters
    ----------
    loader : bool
        Whether the loader has contracts: from `word_at` on, of an IMU `calib_load`.
    """
    found = []
    for text in (routine, definitions, opaque):
        found += [f"{word} takes what follows without a proof" for word in _TAKEN.findall(text)]
        annotations = " ".join(re.findall(r"/\*@.*?\*/", text, re.DOTALL))
        found += [f"{said[0]} compares structures" for said in _STRUCTURES.finditer(annotations)]
    contracts = contracts_of(routine, triad)
    names = list(contracts)
    of_loader = {"word_at", "calib_load"}
    needed = names if loader else list(takewhile(lambda name: name not in of_loader, names))
    found += [f"no contract of {name}" for name in needed if not contracts[name]]
    known = statements_of(definitions)
    for name, statement in statements_of(opaque).items():
        head = re.split(r" reads | = ", statement)[0]
        whole = statement.startswith("lemma") or " = " in statement
        other = known.get(name, statement if whole else "")
        if statement != other if whole else not f"{other} ".startswith(f"{head} "):
            found.append(f"{name} has two meanings")
    return found


def without_goal(goals: Iterable[str], contracts: Mapping[str, str]) -> list[str]:
    """Functions of which not every `ensures` has become a goal; `contracts` by name in goals."""
    made = [re.fullmatch(r"(\w+?)_ensures(?:_\d+)?", goal) for goal in goals]
    counted = [goal[1] for goal in made if goal]
    return [
        name
        for name, contract in contracts.items()
        if counted.count(name) != len(re.findall(r"\bensures\b", contract))
    ]


def unexpected_warning(text: str, *, of_lemmas: bool) -> str:
    """The first warning that is none of those expected; "" where there is none."""
    expected = (*_EXPECTED, *([_OF_OTHERS] if of_lemmas else []))
    for found in _WARNING.findall(text):
        if not found.startswith(expected):
            return " ".join(str(found).split())
    return ""
