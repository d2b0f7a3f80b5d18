"""What is known of the unknowns on one path, and whether something follows from it, by z3.

Products of unknowns are unknowns of their own here, so that z3 sees linear integer arithmetic: what
is known of a product is stated when it is formed.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import z3

from triaxcal.verify.binary.terms import Atoms, Monomial, Poly, poly

RESOURCES = 4_000_000
"""What z3 may spend on a question, in its own units: the same on every machine."""
_NEAR = (0, 1, 2, 4)
"""Steps from the question to the facts that are tried, few first. A question about plain unknowns
(no products), such as that of a branch, is answered from facts about such alone."""


class Facts:
    """Facts that hold on every path, and questions about them and those of a path."""

    def __init__(self, atoms: Atoms) -> None:
        self.atoms = atoms
        self.questions = 0
        self._unknowns: dict[Monomial, z3.ArithRef] = {}
        self._about: dict[Monomial, list[z3.BoolRef]] = {}
        self._inside: dict[int, frozenset[Monomial]] = {}
        self._by_name: dict[str, Monomial] = {}
        self._answers: dict[object, bool] = {}
        self._kept: list[object] = []
        """z3 numbers its terms anew when they are dropped: those asked about are kept."""

    def term(self, value: Poly | int) -> z3.ArithRef:
        """A polynomial for z3."""
        parts: list[Any] = [c * self._unknown(m) if m else z3.IntVal(c) for m, c in poly(value)]
        return z3.Sum(parts) if parts else z3.IntVal(0)

    def know(self, fact: z3.BoolRef) -> None:
        """State a fact of every path."""
        for monomial in self._monomials(fact):
            self._about.setdefault(monomial, []).append(fact)

    def follows(self, claim: z3.BoolRef, path: Iterable[z3.BoolRef] = ()) -> bool:
        """Whether the claim follows from the facts and the path's; no when z3 gives up."""
        path = tuple(path)
        key = (claim.get_id(), *(fact.get_id() for fact in path))
        if key not in self._answers:
            self._answers[key] = any(self._tried(claim, path, near) for near in _NEAR)
            self._kept.append((claim, path))
        return self._answers[key]

    def _tried(self, claim: z3.BoolRef, path: tuple[z3.BoolRef, ...], near: int) -> bool:
        self.questions += 1
        solver = z3.Solver()
        solver.set("rlimit", RESOURCES)
        solver.add(z3.Not(claim), *path)
        seen: set[Monomial] = set()
        stated: set[int] = set()
        plain = self._all_plain(claim)
        new = set(self._monomials(claim)).union(*map(self._monomials, path))
        for _ in range(near):
            found: set[Monomial] = set()
            for monomial in new:
                for fact in self._about.get(monomial, ()):
                    if fact.get_id() not in stated and (not plain or self._all_plain(fact)):
                        stated.add(fact.get_id())
                        solver.add(fact)
                        found |= self._monomials(fact)
            seen |= new
            new = found - seen
        return bool(solver.check() == z3.unsat)

    def _is_plain(self, monomial: Monomial) -> bool:
        inside, _ = self.atoms.floors.get(monomial[0], (None, 0)) if monomial else (None, 0)
        return len(monomial) <= 1 and (inside is None or all(self._is_plain(m) for m, _ in inside))

    def _all_plain(self, fact: z3.BoolRef) -> bool:
        return all(self._is_plain(m) for m in self._monomials(fact))

    def _unknown(self, monomial: Monomial) -> z3.ArithRef:
        if monomial not in self._unknowns:
            name = "*".join(self.atoms.names[a] for a in monomial)
            self._unknowns[monomial] = z3.Int(name)
            self._by_name[name] = monomial
            if len(monomial) == 1 and monomial[0] in self.atoms.floors:
                inside, bits = self.atoms.floors[monomial[0]]
                rest = self.term(inside) - self._unknowns[monomial] * (1 << bits)
                self.know(z3.And(rest >= 0, rest < (1 << bits)))
        return self._unknowns[monomial]

    def _monomials(self, formula: z3.ExprRef) -> frozenset[Monomial]:
        number = formula.get_id()
        if number not in self._inside:
            if z3.is_const(formula):
                name = formula.decl().name()
                found = frozenset({self._by_name[name]} if name in self._by_name else ())
            else:
                found = frozenset().union(*map(self._monomials, formula.children()))
            self._inside[number] = found
            self._kept.append(formula)
        return self._inside[number]
