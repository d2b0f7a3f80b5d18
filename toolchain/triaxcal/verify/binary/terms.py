"""Integer polynomials whose atoms are unknowns and floors of polynomials over a power of two.

Both sides of a proof are brought into one form, so that most equalities are identities. The rules,
for integers a, b, P, Q:

    floor((2^b Q + P) / 2^b)             = Q + floor(P / 2^b)
    floor(2^a P / 2^(a+b))               = floor(P / 2^b)
    floor((Q + floor(P / 2^a)) / 2^b)    = floor((2^a Q + P) / 2^(a+b))

An expression a mod 2^b is a - 2^b floor(a / 2^b), and needs no rule of its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property

Monomial = tuple[int, ...]
"""Numbers of atoms, rising; () is 1."""


class Poly:
    """A polynomial with integer coefficients; equal when its terms are."""

    def __init__(self, terms: Mapping[Monomial, int]) -> None:
        self.terms = {m: c for m, c in sorted(terms.items()) if c}

    @cached_property
    def _key(self) -> tuple[tuple[Monomial, int], ...]:
        return tuple(self.terms.items())

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Poly) and self._key == other._key

    def __iter__(self) -> Iterator[tuple[Monomial, int]]:
        return iter(self.terms.items())

    def __add__(self, other: Poly | int) -> Poly:
        terms = dict(self.terms)
        for m, c in poly(other):
            terms[m] = terms.get(m, 0) + c
        return Poly(terms)

    def __sub__(self, other: Poly | int) -> Poly:
        return self + poly(other) * -1

    def __mul__(self, other: Poly | int) -> Poly:
        terms: dict[Monomial, int] = {}
        for m, c in self:
            for n, d in poly(other):
                product = tuple(sorted(m + n))
                terms[product] = terms.get(product, 0) + c * d
        return Poly(terms)

    @property
    def number(self) -> int | None:
        """Its value, when it holds no unknown."""
        return self.terms.get((), 0) if self.terms.keys() <= {()} else None


def poly(value: Poly | int) -> Poly:
    """A number as a polynomial."""
    return value if isinstance(value, Poly) else Poly({(): value})


class Atoms:
    """Unknowns and floors, by number."""

    def __init__(self) -> None:
        self.names: list[str] = []
        self.floors: dict[int, tuple[Poly, int]] = {}
        self._numbers: dict[object, int] = {}

    def unknown(self, name: str) -> Poly:
        """An unknown integer; another one for each name."""
        return Poly({(self._number(name, name),): 1})

    def floor(self, value: Poly, bits: int) -> Poly:
        """floor(value / 2^bits), brought into the one form."""
        while bits > 0:
            whole = Poly({m: c >> bits for m, c in value})
            rest = Poly({m: c & ((1 << bits) - 1) for m, c in value})
            inner = next(
                (m for m, c in rest if c == 1 and len(m) == 1 and m[0] in self.floors), None
            )
            if inner is not None:
                below, more = self.floors[inner[0]]
                rest = (rest - Poly({inner: 1})) * (1 << more) + below
                return whole + self.floor(rest, bits + more)
            if rest.number is not None:
                return whole + (rest.number >> bits)
            common = min(_twos(c) for _, c in rest)
            if common == 0:
                number = self._number((rest, bits), f"floor{len(self.names)}")
                self.floors[number] = rest, bits
                return whole + Poly({(number,): 1})
            rest = Poly({m: c >> common for m, c in rest})
            return whole + self.floor(rest, bits - common)
        return value * (1 << -bits)

    def _number(self, key: object, name: str) -> int:
        if key not in self._numbers:
            self._numbers[key] = len(self.names)
            self.names.append(name)
        return self._numbers[key]


def _twos(number: int) -> int:
    return (number & -number).bit_length() - 1
