"""The two functions of the routine, compiled, against docs/explanation/fixed-point.md.

For every image that the loader accepts, every temperature code and all raw codes: the words that
`set_temperature` leaves are the same function of the twelve values N_ij, b_i on every way through
it, and from them `apply` forms floor((sum_j N_ij u_j + b_i 2^32) / 2^output_shift), or with sums of
high words floor((sum_j floor(N_ij u_j / 2^32) + b_i) / 2^(output_shift - 32)).
"""

from __future__ import annotations

from dataclasses import dataclass

import z3

from triaxcal.fixedpoint.arithmetic import INT32_MAX
from triaxcal.fixedpoint.gyro import SENSITIVITY_LIMIT
from triaxcal.fixedpoint.shape import Shape
from triaxcal.verify.binary.facts import Facts
from triaxcal.verify.binary.listing import Listing
from triaxcal.verify.binary.machine import Core, State, ways
from triaxcal.verify.binary.terms import Atoms, Poly, poly
from triaxcal.verify.binary.values import UnprovenError, Value, Words, constant

STATE, CALIB, RAW, ACCEL = 0x2000_0000, 0x2000_1000, 0x2000_4000, 0x2000_5000
FORCE = 0x2000_6000
"""Where the arguments stand."""
TEMP_LOW, TEMP_HIGH, RAW_RANGE = 1, 2, 4
"""Status bits."""


@dataclass(frozen=True)
class Proven:
    """What was shown of one function.

    Attributes
    ----------
    function : str
    ways : int
        Ways through it, each of them shown.
    questions : int
        Questions that z3 answered.
    """

    function: str
    ways: int
    questions: int


class Routine:
    """The specification's unknowns, and what the loader guarantees of them."""

    def __init__(self, shape: Shape, row_words: int) -> None:
        self.shape = shape
        self.row_words = row_words
        self.atoms = Atoms()
        self.facts = Facts(self.atoms)
        self.words = Words(self.atoms, self.facts)
        self.memory: dict[int, Value] = {}
        self.temp = self.words.unknown("t")
        self.least, self.most = self._word(CALIB, "temp_min"), self._word(CALIB + 4, "temp_max")
        self._know(self._term(self.least) <= self._term(self.most))
        self.segments = [self._segment(s) for s in range(shape.segments)]
        self.values = [self.words.unknown(name, -INT32_MAX) for name in _VALUE_NAMES]
        self.codes = [self.words.unknown(f"u{axis}") for axis in "xyz"]
        for row in range(3):
            self._limit_row(self.values[4 * row : 4 * row + 4])
        self.forces = [self.words.unknown(f"f{axis}") for axis in "xyz" if shape.gyro]
        self.sensitivity = [self._sensitivity(row) for row in range(3 if shape.gyro else 0)]

    @property
    def state_words(self) -> int:
        """Words that `set_temperature` leaves."""
        return 3 * self.row_words + 9 * self.shape.gyro

    @property
    def arguments(self) -> dict[str, Value]:
        """Of `apply`, without the last."""
        force = {"force": constant(FORCE)} if self.shape.gyro else {}
        return {"state": constant(STATE), "raw_code": constant(RAW), **force}

    def _word(self, address: int, name: str) -> Value:
        value = self.words.unknown(name)
        self.memory[address] = value
        return value

    def _term(self, value: Value) -> z3.ArithRef:
        return self.facts.term(value.poly)

    def _know(self, fact: z3.BoolRef) -> None:
        self.facts.know(fact)

    def _segment(self, s: int) -> Segment:
        size = 3 + 12 * (self.shape.order + 1)
        at = CALIB + 8 + 4 * size * s
        first, origin, gain = (
            self._word(at + 4 * i, f"{n}{s}") for i, n in enumerate(("first", "origin", "gain"))
        )
        coefficients = [
            [
                self._word(
                    at + 12 + 4 * (f * (self.shape.order + 1) + k), f"c{s}{_VALUE_NAMES[f]}{k}"
                )
                for k in range(self.shape.order + 1)
            ]
            for f in range(12)
        ]
        self._know(self._term(gain) > 0)
        return Segment(first, origin, gain, coefficients)

    def _limit_row(self, row: list[Value]) -> None:
        """The loader's limit of a row, and what it says of products with codes in range."""
        sizes = [z3.If(self._term(v) >= 0, self._term(v), -self._term(v)) for v in row]
        self._know(z3.Sum(*sizes[:3], 2 * sizes[3]) < self.shape.row_limit)
        least, most = self.shape.raw_min, self.shape.raw_max
        for value, size, code in zip(row[:3], sizes[:3], self.codes, strict=True):
            u, c = self._term(code), self.facts.term(value.poly * code.poly)
            reach = max(abs(least), abs(most)) * size
            self._know(z3.Implies(z3.And(u >= least, u <= most), z3.And(c >= -reach, c <= reach)))

    def _sensitivity(self, row: int) -> list[Value]:
        """A row of a gyro's g-sensitivity, step G: its limit, and products with any force."""
        at = CALIB + 8 + 4 * ((3 + 12 * (self.shape.order + 1)) * self.shape.segments + 3 * row)
        words = [self._word(at + 4 * j, f"k{row}{j}") for j in range(3)]
        sizes = [z3.If(self._term(k) >= 0, self._term(k), -self._term(k)) for k in words]
        self._know(z3.Sum(*sizes) <= SENSITIVITY_LIMIT)
        total = sum((k.poly * f.poly for k, f in zip(words, self.forces, strict=True)), poly(0))
        self._know(z3.And(self.facts.term(total) >= -(2**60), self.facts.term(total) <= 2**60))
        for k, size_of, force in zip(words, sizes, self.forces, strict=True):
            c, reach = self.facts.term(k.poly * force.poly), 2**31 * size_of
            self._know(z3.And(c >= -reach, c <= reach))
        return words

    # ---- what is expected ----

    def name_values(self) -> None:
        """Name what Horner's rule gives at each step, for each code in use and each segment."""
        limits = {"t": self.temp, "low": self.least, "high": self.most}
        for s, segment in enumerate(self.segments):
            for code in limits.values():
                self._name_argument(s, segment, code)

    def _name_argument(self, s: int, segment: Segment, code: Value) -> None:
        words = self.words
        inside = z3.And(
            self._term(self.least) <= self._term(code), self._term(code) <= self._term(self.most)
        )
        if s > 0:
            inside = z3.And(inside, self._term(segment.first) <= self._term(code))
        if s + 1 < len(self.segments):
            after = self.segments[s + 1].first
            inside = z3.And(inside, self._term(code) < self._term(after))
        x = words.unknown(f"x{s}", -INT32_MAX)
        argument = words.multiply(words.subtract(code, segment.origin), segment.gain)
        words.names.setdefault(argument.poly, []).append((x, inside))
        short = self.atoms.floor(x.poly, 16) * (1 << 16)
        is_short = self._term(x) == self.facts.term(short)
        for f in range(12):
            value = segment.coefficients[f][self.shape.order]
            for k in range(self.shape.order - 1, -1, -1):
                c = segment.coefficients[f][k].poly
                after = self.values[f] if k == 0 else words.unknown(f"p{s}{f}{k}", -INT32_MAX)
                for argument_poly, condition in ((x.poly, z3.BoolVal(True)), (short, is_short)):
                    step = c + self.atoms.floor(argument_poly * value.poly, 32)
                    words.names.setdefault(step, []).append((after, condition))
                value = after
            if self.shape.order == 0:
                words.names.setdefault(value.poly, []).append((self.values[f], z3.BoolVal(True)))


@dataclass(frozen=True)
class Segment:
    """Unknowns of one segment of the image; coefficients of twelve functions, constant first."""

    first: Value
    origin: Value
    gain: Value
    coefficients: list[list[Value]]


_VALUE_NAMES = tuple(f"{n}{axis}" for axis in "xyz" for n in ("Nx", "Ny", "Nz", "b"))
"""N_ij and b_i in the order of the image."""


def prove_routine(
    shape: Shape, row_words: int, core: Core, listing: Listing, functions: tuple[str, str]
) -> tuple[Proven, Proven]:
    """Show that `set_temperature` and `apply`, by their link names, do what is specified.

    Raises
    ------
    UnprovenError
        When a step or a result cannot be shown; the message says which.
    """
    routine = Routine(shape, row_words)
    routine.name_values()
    first, state = _set_temperature(routine, core, listing, functions[0])
    second = _apply(routine, core, listing, functions[1], state)
    return first, second


def _start(routine: Routine, results: dict[int, str]) -> State:
    return State(routine.words, {}, dict(routine.memory), results)


def _set_temperature(
    routine: Routine, core: Core, listing: Listing, function: str
) -> tuple[Proven, list[Value]]:
    results = {STATE + 4 * i: "state" for i in range(routine.state_words)}
    arguments = constant(STATE), constant(CALIB), routine.temp
    left: list[Value] | None = None
    count = 0
    for end in ways(core, listing, function, _start(routine, results), arguments):
        count += 1
        _refuse_status(routine, end, core)
        words = [end.load(constant(at)) for at in results]
        if left is None:
            left = words
        elif [w.poly for w in words] != [w.poly for w in left]:
            raise UnprovenError(f"{function}: two ways through it leave different words")
    assert left is not None
    sensitivity = [k for row in routine.sensitivity for k in row]
    allowed = {m for value in (*routine.values, *sensitivity) for m, _ in value.poly}
    for index, word in enumerate(left):
        if not _atoms_of(routine.atoms, word.poly) <= {m[0] for m in allowed if m}:
            raise UnprovenError(f"{function}: word {index} is not a function of N and b")
    return Proven(function, count, routine.facts.questions), left


def _atoms_of(atoms: Atoms, value: Poly) -> set[int]:
    found: set[int] = set()
    for monomial, _ in value:
        for atom in monomial:
            found |= _atoms_of(atoms, atoms.floors[atom][0]) if atom in atoms.floors else {atom}
    return found


def _refuse_status(routine: Routine, end: State, core: Core) -> None:
    term, words = routine.facts.term, end.words
    t, least, most = (term(v.poly) for v in (routine.temp, routine.least, routine.most))
    wanted = z3.If(t < least, TEMP_LOW, z3.If(t > most, TEMP_HIGH, 0))
    status = term(end.registers[core.arguments[0]].poly)
    if not words.follows(status == wanted):
        raise UnprovenError("set_temperature: the status is not the specified one")


def _apply(
    routine: Routine, core: Core, listing: Listing, function: str, state: list[Value]
) -> Proven:
    shape, facts = routine.shape, routine.facts
    asked = facts.questions
    count = 0
    for accel in (ACCEL, RAW, *([FORCE] if shape.gyro else [])):  # the docs allow one array
        start = _start(routine, {accel + 4 * i: "accel" for i in range(3)})
        start.memory |= {STATE + 4 * i: value for i, value in enumerate(state)}
        start.memory |= {RAW + 4 * j: code for j, code in enumerate(routine.codes)}
        start.memory |= {FORCE + 4 * j: force for j, force in enumerate(routine.forces)}
        arguments = (*routine.arguments.values(), constant(accel))
        for end in ways(core, listing, function, start, arguments):
            count += 1
            used = tuple(_clamped(shape, end.words, code) for code in routine.codes)
            outside = z3.Or([_outside(shape, end.words, code) for code in routine.codes])
            status = facts.term(end.registers[core.arguments[0]].poly)
            if not end.words.follows(status == z3.If(outside, RAW_RANGE, 0)):
                raise UnprovenError(f"{function}: the status is not the specified one")
            for i in range(3):
                _refuse_result(routine, end, i, used, end.load(constant(accel), 4 * i))
    return Proven(function, count, facts.questions - asked)


def _clamped(shape: Shape, words: Words, code: Value) -> Value:
    """A raw code brought into its range: which of the three it is, is known on each way."""
    least, most = constant(shape.raw_min), constant(shape.raw_max)
    if words.follows(z3.Not(words.less(least, code, signed=True))):
        return least
    if words.follows(z3.Not(words.less(code, most, signed=True))):
        return most
    if not words.follows(z3.Not(_outside(shape, words, code))):
        raise UnprovenError("apply: a way on which a code may be inside and outside of its range")
    return code


def _outside(shape: Shape, words: Words, code: Value) -> z3.BoolRef:
    """Condition that a raw code is outside of its range."""
    least, most = constant(shape.raw_min), constant(shape.raw_max)
    return z3.Or(words.less(code, least, signed=True), words.less(most, code, signed=True))


def _refuse_result(
    routine: Routine, end: State, i: int, used: tuple[Value, ...], found: Value
) -> None:
    shape, row = routine.shape, routine.values[4 * i : 4 * i + 4]
    total = row[3].poly * (1 << 32)
    for n, u in zip(row[:3], used, strict=True):
        product = n.poly * u.poly * (1 << shape.raw_shift)
        if shape.high_words:
            product = routine.atoms.floor(product, 32) * (1 << 32)
        total = total + product
    for k, force in zip(routine.sensitivity[i] if shape.gyro else (), routine.forces, strict=True):
        total = total + k.poly * force.poly
    wanted = routine.atoms.floor(total, shape.output_shift)
    if end.words.signed(found).poly != wanted and not end.words.follows(
        routine.facts.term(found.poly) == routine.facts.term(wanted)
    ):
        raise UnprovenError(f"apply: accel[{i}] is not the specified floor")
