"""Words of 32 bits as polynomials: what the instructions do to them, without loss."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import reduce

import z3

from triaxcal.verify.binary.facts import Facts
from triaxcal.verify.binary.terms import Atoms, Poly, poly

WORD = 1 << 32
INT32_MIN, INT32_MAX = -(1 << 31), (1 << 31) - 1


class UnprovenError(Exception):
    """A step that could not be shown; the message names it."""


@dataclass(frozen=True)
class Value:
    """A word: an integer that is congruent to it modulo 2^32, and between which bounds it lies.

    `parts` are the two words whose sum it is, where it is one, and `either` those whose bits were
    joined by "or": what a comparison then says of carries and ranges follows from them.
    """

    poly: Poly
    low: int
    high: int
    parts: tuple[Value, Value] | None = None
    either: tuple[Value, ...] = ()

    @property
    def number(self) -> int | None:
        """The word without sign, when it holds no unknown."""
        number = self.poly.number
        return None if number is None else number % WORD


def constant(number: int) -> Value:
    """A word that is known."""
    return Value(poly(number), number, number)


def shift_of(value: Value) -> int:
    """The number of bits by which a word is shifted.

    Raises
    ------
    UnprovenError
        When it depends on the inputs.
    """
    if value.number is None or not 0 <= value.number < 32:
        raise UnprovenError("a shift that depends on the inputs")
    return value.number


class Words:
    """Arithmetic of words on one path, whose own facts are `path`."""

    def __init__(self, atoms: Atoms, facts: Facts, path: Iterable[z3.BoolRef] = ()) -> None:
        self.atoms = atoms
        self.facts = facts
        self.path = list(path)
        self.names: dict[Poly, list[tuple[Value, z3.BoolRef]]] = {}

    def copy(self) -> Words:
        """The same, for a path that goes on by itself."""
        other = Words(self.atoms, self.facts, self.path)
        other.names = self.names
        return other

    def unknown(self, name: str, low: int = INT32_MIN, high: int = INT32_MAX) -> Value:
        """A word of which the bounds alone are known."""
        value = self.atoms.unknown(name)
        term = self.facts.term(value)
        self.facts.know(z3.And(term >= low, term <= high))
        return Value(value, low, high)

    def named(self, value: Value) -> Value:
        """The unknown of the specification that this is, where it is one; otherwise the value."""
        for name, condition in self.names.get(value.poly, ()):
            if self.follows(condition):
                return name
        return value

    def follows(self, claim: z3.BoolRef) -> bool:
        """Whether a claim follows on this path."""
        return self.facts.follows(claim, self.path)

    def add(self, a: Value, b: Value) -> Value:
        """a + b."""
        return Value(a.poly + b.poly, a.low + b.low, a.high + b.high, parts=(a, b))

    def subtract(self, a: Value, b: Value) -> Value:
        """a - b."""
        return Value(a.poly - b.poly, a.low - b.high, a.high - b.low)

    def multiply(self, a: Value, b: Value) -> Value:
        """a b, all of it: a number of 64 bits, whose lower word it is congruent to."""
        corners = [x * y for x in (a.low, a.high) for y in (b.low, b.high)]
        product = Value(a.poly * b.poly, min(corners), max(corners))
        if a.poly.number is None and b.poly.number is None:
            self._know_product(a, b, product)
        return product

    def _know_product(self, a: Value, b: Value, product: Value) -> None:
        """What linear arithmetic cannot see: how large a product is."""
        c = self.facts.term(product.poly)
        self.facts.know(z3.And(c >= product.low, c <= product.high))
        for one, other in ((a, b), (b, a)):
            x = self.facts.term(one.poly)
            low, high = other.low, other.high
            self.facts.know(
                z3.If(
                    x >= 0,
                    z3.And(c >= low * x, c <= high * x),
                    z3.And(c >= high * x, c <= low * x),
                )
            )

    def signed(self, a: Value) -> Value:
        """The word as a number of -2^31 to 2^31 - 1."""
        if a.low >= INT32_MIN and a.high <= INT32_MAX:
            return a
        if a.number is not None:
            return constant(a.number - WORD if a.number > INT32_MAX else a.number)
        term = self.facts.term(a.poly)
        if self.follows(z3.And(term >= INT32_MIN, term <= INT32_MAX)):
            return Value(a.poly, max(a.low, INT32_MIN), min(a.high, INT32_MAX))
        turns = self.atoms.floor(a.poly - INT32_MIN, 32)
        return Value(a.poly - turns * WORD, INT32_MIN, INT32_MAX)

    def unsigned(self, a: Value) -> Value:
        """The word as a number of 0 to 2^32 - 1."""
        return self.low_bits(a, 32)

    def shift_left(self, a: Value, bits: int) -> Value:
        """a 2^bits."""
        return Value(a.poly * (1 << bits), a.low << bits, a.high << bits)

    def floor(self, a: Value, bits: int) -> Value:
        """floor(a / 2^bits), of the number as it stands."""
        if a.either:
            first, *others = (self.floor(self.unsigned(part), bits) for part in a.either)
            return reduce(self.either, others, first)
        return Value(self.atoms.floor(a.poly, bits), a.low >> bits, a.high >> bits)

    def low_bits(self, a: Value, bits: int) -> Value:
        """a mod 2^bits, bits at most 32."""
        if a.low >= 0 and a.high < (1 << bits):
            return a
        rest = a.poly - self.atoms.floor(a.poly, bits) * (1 << bits)
        return Value(rest, 0, (1 << bits) - 1)

    def wide(self, low: Value, high: Value) -> Value:
        """The number of 64 bits with these words, with its sign."""
        low, high = self.unsigned(low), self.signed(high)
        return Value(
            low.poly + high.poly * WORD, low.low + high.low * WORD, low.high + high.high * WORD
        )

    def halves(self, a: Value) -> tuple[Value, Value]:
        """Lower and higher word of a number that has to fit into 64 bits with its sign."""
        least, most = -(1 << 63), (1 << 63) - 1
        if not (least <= a.low and a.high <= most):
            term = self.facts.term(a.poly)
            if not self.follows(z3.And(term >= least, term <= most)):
                raise UnprovenError("a sum of 64 bits may leave its type")
            a = Value(a.poly, max(a.low, least), min(a.high, most))
        return a, self.floor(a, 32)

    def less(self, a: Value, b: Value, *, signed: bool) -> z3.BoolRef:
        """Condition a < b."""
        if not signed and a.either and b.number is not None and b.number & (b.number - 1) == 0:
            return z3.And([self.less(part, b, signed=False) for part in a.either])
        within = self.signed if signed else self.unsigned
        return self.facts.term(within(a).poly) < self.facts.term(within(b).poly)

    def equal(self, a: Value, b: Value) -> z3.BoolRef:
        """Condition a = b."""
        if a.either and b.number == 0:
            return z3.And([self.equal(part, b) for part in a.either])
        a, b = self.signed(a), self.signed(b)
        return self.facts.term(a.poly) == self.facts.term(b.poly)

    def carry(self, total: Value) -> Value:
        """The carry of a sum of two words without sign."""
        assert total.parts is not None
        one, other = (self.unsigned(part) for part in total.parts)
        return self.floor(self.add(one, other), 32)

    def masked(self, a: Value, b: Value) -> Value:
        """The bits of both, where one is a known mask of the lowest bits."""
        if a.number is not None:
            a, b = b, a
        if b.number is None or b.number & (b.number + 1):
            raise UnprovenError("a mask that the proof does not know")
        return self.low_bits(a, b.number.bit_length())

    def either(self, a: Value, b: Value) -> Value:
        """The bits of either."""
        parts = (*(a.either or (a,)), *(b.either or (b,)))
        name = " or ".join(str(hash(part.poly)) for part in parts)
        joined = Value(self.atoms.unknown(name), 0, WORD - 1, either=parts)
        none = z3.And([self.equal(part, constant(0)) for part in parts])
        self.facts.know((self.facts.term(joined.poly) == 0) == none)
        return joined
