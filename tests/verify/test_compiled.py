"""The compiled routine, followed instruction by instruction: right, and no fault is believed."""

from __future__ import annotations

import re
from dataclasses import replace
from math import prod
from pathlib import Path
from random import Random

import numpy as np
import pytest

from conftest import needs
from triaxcal.codegen.forms import row_words
from triaxcal.codegen.names import names_of
from triaxcal.codegen.render import arithmetic_of
from triaxcal.fixedpoint.integer_model import apply, set_temperature
from triaxcal.fixedpoint.plan import with_high_words
from triaxcal.fixedpoint.proof import prove
from triaxcal.verify.campaign import CHECKS
from triaxcal.verify.outcome import NOT_DONE, PASSED
from triaxcal.verify.workspace import Workspace

pytest.importorskip("z3", reason="the package z3-solver is not installed")

from triaxcal.targets.bench import best_form
from triaxcal.targets.cores.registry import CORES
from triaxcal.targets.shapes import unit_case
from triaxcal.verify import compiled
from triaxcal.verify.binary.facts import Facts
from triaxcal.verify.binary.listing import Instruction, Listing
from triaxcal.verify.binary.machine import State, ways
from triaxcal.verify.binary.routine import ACCEL, CALIB, RAW, STATE, prove_routine
from triaxcal.verify.binary.terms import Atoms, Poly
from triaxcal.verify.binary.values import UnprovenError, Words, constant

SHAPE = "direct-two-segments"
UNITS = Path(__file__).parents[2] / "units"
NAMES = ("Cortex-M0", "Cortex-M3", "Cortex-M4F", "RV32IM")
COMPILERS = needs("arm-none-eabi-gcc", "riscv64-unknown-elf-gcc")


# ---- the one form ----


def value_of(atoms: Atoms, poly: Poly, known: dict[int, int]) -> int:
    def atom_value(atom: int) -> int:
        if atom not in atoms.floors:
            return known[atom]
        inside, bits = atoms.floors[atom]
        return value_of(atoms, inside, known) // 2**bits

    return sum(c * prod(map(atom_value, monomial)) for monomial, c in poly)


def test_the_one_form_keeps_the_number() -> None:
    rng = Random(1)
    for _ in range(300):
        atoms = Atoms()
        unknowns = [atoms.unknown(name) for name in "abcd"]
        numbers = [rng.randrange(-(2**31), 2**31) for _ in unknowns]
        known = {next(iter(u.terms))[0]: n for u, n in zip(unknowns, numbers, strict=True)}
        polys, plain = [*unknowns], [*numbers]
        for _ in range(12):
            i, j = rng.randrange(len(polys)), rng.randrange(len(polys))
            bits = rng.randrange(1, 33)
            made = [
                (polys[i] + polys[j], plain[i] + plain[j]),
                (polys[i] - polys[j], plain[i] - plain[j]),
                (atoms.floor(polys[i], bits), plain[i] // 2**bits),
                (polys[i] * 2**bits, plain[i] * 2**bits),
                (unknowns[i % 4] * unknowns[j % 4], numbers[i % 4] * numbers[j % 4]),
            ]
            poly, number = rng.choice(made)
            polys.append(poly)
            plain.append(number)
        assert [value_of(atoms, p, known) for p in polys] == plain


def test_what_differs_has_two_forms() -> None:
    atoms = Atoms()
    a, b = atoms.unknown("a"), atoms.unknown("b")
    assert atoms.floor(a + b, 4) != atoms.floor(a, 4) + atoms.floor(b, 4)
    assert atoms.floor(atoms.floor(a, 3) + b, 5) == atoms.floor(a + b * 8, 8)
    assert atoms.floor(a * 32 + b * 64, 7) == atoms.floor(a + b * 2, 2)


# ---- a shape's routine, compiled ----


@pytest.fixture(scope="module")
def work(subjects, tmp_path_factory) -> Workspace:
    made = subjects[SHAPE]
    folder = tmp_path_factory.mktemp("binary")
    return Workspace.create(folder, made.files, made.plan, made.bound)


@pytest.fixture(scope="module")
def listings(work: Workspace) -> dict[str, str]:
    return {c.name: compiled.disassembled(work, c) for c in CORES if c.name in NAMES}


def functions(work: Workspace) -> tuple[str, str]:
    linked = names_of(work.plan).linked
    return f"{linked}_set_temperature", f"{linked}_apply"


def core_of(name: str):
    return next(core for core in CORES if core.name == name)


def proven(work: Workspace, name: str, listing: Listing):
    core = core_of(name)
    form = arithmetic_of(replace(work.plan, arithmetic=best_form(core)))
    words = row_words(work.plan.shape, form)
    return prove_routine(
        work.plan.shape, words, compiled.instructions(core), listing, functions(work)
    )


def run(work: Workspace, name: str, listing: Listing, temp: int, raw: list[int]) -> list[int]:
    """Answers of the machine for known inputs: status, accel x, y, z, status."""
    plan, core = work.plan, compiled.instructions(core_of(name))
    atoms = Atoms()
    words = Words(atoms, Facts(atoms))
    memory = {CALIB: constant(plan.temp_min_code), CALIB + 4: constant(plan.temp_max_code)}
    at = CALIB + 8
    for segment in plan.segments:
        numbers = [segment.first_code, segment.origin_code, segment.gain]
        numbers += [c for row in segment.coefficients for c in row]
        for number in numbers:
            memory[at] = constant(int(number))
            at += 4
    memory |= {RAW + 4 * j: constant(code) for j, code in enumerate(raw)}
    writable = {STATE + 4 * i: "state" for i in range(30)} | {ACCEL + 4 * i: "" for i in range(3)}
    start = State(words, {}, memory, writable)
    set_temp, applied = functions(work)
    (end,) = ways(
        core, listing, set_temp, start, (constant(STATE), constant(CALIB), constant(temp))
    )
    first = words.signed(end.registers[core.arguments[0]]).number
    start = State(words, {}, end.memory, writable)
    arguments = constant(STATE), constant(RAW), constant(ACCEL)
    (end,) = ways(core, listing, applied, start, arguments)
    accel = [words.signed(end.memory[ACCEL + 4 * i]).poly.number for i in range(3)]
    return [first, *accel, end.registers[core.arguments[0]].number]


def expected(work: Workspace, temp: int, raw: list[int]) -> list[int]:
    state, flags = set_temperature(work.plan, np.array([temp]))
    accel, more = apply(work.plan, state, np.array([raw]))
    return [int(flags[0]), *(int(a) for a in accel[0]), int(more[0])]


def vectors(work: Workspace) -> list[tuple[int, list[int]]]:
    rng = Random(2)
    plan = work.plan
    edges = [plan.temp_min_code, plan.temp_max_code, plan.temp_min_code - 1, 2**31 - 1, -(2**31)]
    edges += [s.first_code + d for s in plan.segments for d in (-1, 0)]
    temps = edges + [rng.randrange(plan.temp_min_code, plan.temp_max_code) for _ in range(4)]
    return [
        (t, [rng.choice((-(2**31), 2**31 - 1, rng.randrange(-(2**31), 2**31))) for _ in range(3)])
        for t in temps
    ]


@COMPILERS
@pytest.mark.parametrize("name", NAMES)
def test_the_machine_does_what_the_integer_model_does(work, listings, name: str) -> None:
    listing = Listing(listings[name])
    for temp, raw in vectors(work):
        assert run(work, name, listing, temp, raw) == expected(work, temp, raw)


@COMPILERS
@pytest.mark.parametrize("name", NAMES)
def test_proven_for_every_input(work, listings, name: str) -> None:
    temperature, applied = proven(work, name, Listing(listings[name]))
    assert temperature.ways >= 3 * len(work.plan.segments)
    assert applied.ways == 2  # no codes are out of range; with accel apart from raw_code and not


@COMPILERS
@pytest.mark.parametrize(
    "name",
    ["Cortex-M3", *(pytest.param(n, marks=pytest.mark.slow) for n in ("Cortex-M0", "RV32IM"))],
)
def test_codes_out_of_range_are_proven_on_every_way(name: str, tmp_path: Path) -> None:
    """AT-SIM: each code below, inside and above its range, accel apart from raw_code and not."""
    case = unit_case(UNITS / "AT-SIM")
    files = {file: text.encode() for file, text in case.files.items()}
    work = Workspace.create(tmp_path / "work", files, case.plan, prove(case.plan))
    core = core_of(name)
    _, applied = proven(work, name, Listing(compiled.disassembled(work, core)))
    assert applied.ways == 2 * 3**3


@COMPILERS
@pytest.mark.slow
@pytest.mark.parametrize("name", ["Cortex-M3", "RV32IM"])
def test_a_gyro_is_proven_for_any_force(subjects, name: str, tmp_path: Path) -> None:
    """Each code below, inside and above its range; rate apart, in place of raw_code, of force."""
    made = subjects["gyro"]
    work = Workspace.create(tmp_path / "work", made.files, made.plan, made.bound)
    _, applied = proven(work, name, Listing(compiled.disassembled(work, core_of(name))))
    assert applied.ways == 3 * 3**3


@COMPILERS
def test_a_wrong_sensitivity_is_not_proven(subjects, tmp_path: Path) -> None:
    """A word of k of another row: the words of the state are in order, the results are not."""
    made = subjects["gyro"]
    work = Workspace.create(tmp_path / "work", made.files, made.plan, made.bound)
    listing = Listing(compiled.disassembled(work, core_of("Cortex-M3")))
    code = listing.of(functions(work)[1])
    last = next(i.operands[-1] for i in code if "#80]" in i.operands[-1])  # k of z by z
    wanted = last.replace("#80]", "#48]")
    changed = next(i for i in code if i.operands[-1] == wanted)
    operands = (*changed.operands[:-1], last.replace("#80]", "#60]"))
    listing.replace(replace(changed, operands=operands))
    with pytest.raises(UnprovenError, match=r"is not the specified floor|may leave its type"):
        proven(work, "Cortex-M3", listing)


@COMPILERS
def test_sums_of_high_words_are_proven_and_are_no_64_bit_sums(subjects, tmp_path: Path) -> None:
    made = subjects[SHAPE]
    plan = with_high_words(made.plan)
    work = Workspace.create(tmp_path / "work", made.files, plan, made.bound)
    listing = Listing(compiled.disassembled(work, core_of("RV32IM")))
    _, applied = proven(work, "RV32IM", listing)
    assert applied.ways == 2
    with pytest.raises(UnprovenError, match=r"accel\[0\] is not the specified floor"):
        prove_routine(
            made.plan.shape, 4, compiled.instructions(core_of("RV32IM")), listing, functions(work)
        )


def test_a_core_whose_products_are_a_librarys_is_not_done(subjects, tmp_path, monkeypatch) -> None:
    made = subjects["gyro"]
    work = Workspace.create(tmp_path / "work", made.files, made.plan, made.bound)
    monkeypatch.setattr(compiled, "proven", lambda _work, core: {"name": core.name})
    monkeypatch.setattr(compiled, "missing_tools", lambda _tools: [])
    outcome = compiled.check(work)
    assert outcome.finding.startswith("5 of 6 cores: ")
    assert outcome.finding.endswith("; Cortex-M0 not done: a library forms its products")


def test_an_or_is_zero_where_all_its_parts_are() -> None:
    atoms = Atoms()
    words = Words(atoms, Facts(atoms))
    a, b = words.unknown("a"), words.unknown("b")
    joined = words.floor(words.either(a, b), 24)
    term = words.facts.term
    assert not words.follows(term(joined.poly) == 0)
    words.path.append(words.equal(joined, constant(0)))
    assert words.follows(term(joined.poly) == 0)
    assert words.follows(term(a.poly) < 2**24)
    assert not words.follows(term(a.poly) == 0)


# ---- faults ----


def faulty(instruction: Instruction, rng: Random) -> Instruction | None:
    """The instruction with one fault that an assembler would take, or nothing."""
    operands = list(instruction.operands)
    numbers = [i for i, o in enumerate(operands) if re.fullmatch(r"#?-?\d+|#?0x[0-9a-f]+", o)]
    registers = [i for i, o in enumerate(operands) if re.fullmatch(r"[rats]\d+|ip|sl|fp|lr", o)]
    if numbers and rng.random() < 0.6:
        i = rng.choice(numbers)
        value = int(operands[i].removeprefix("#"), 0) + rng.choice((-1, 1))
        operands[i] = f"{'#' if operands[i].startswith('#') else ''}{value}"
    elif instruction.name in OTHER and rng.random() < 0.5:
        return replace(instruction, name=OTHER[instruction.name])
    elif len(registers) >= 2:
        i, j = rng.sample(registers, 2)
        operands[i], operands[j] = operands[j], operands[i]
    else:
        return None
    changed = replace(instruction, operands=tuple(operands))
    return None if changed == instruction else changed


OTHER = {
    "adds": "subs", "add": "sub", "sub": "add", "subs": "adds", "asrs": "lsrs", "lsrs": "asrs",
    "smlal": "smull", "mulh": "mul", "srai": "srli", "bge": "blt", "movgt": "movle", "mul": "mulh",
}  # fmt: skip


@COMPILERS
@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_fault_that_changes_an_answer_is_not_proven(work, listings, name: str) -> None:
    """Twenty faults each: what is proven all the same gives the same answers."""
    rng = Random(3)
    listing = Listing(listings[name])
    code = [i for f in functions(work) for i in listing.of(f)]
    refused = seeded = 0
    while seeded < 20:
        instruction = rng.choice(code)
        fault = faulty(instruction, rng)
        if fault is None:
            continue
        seeded += 1
        changed = Listing(listings[name])
        changed.replace(fault)
        try:
            proven(work, name, changed)
        except UnprovenError:
            refused += 1
            continue
        for temp, raw in vectors(work):
            assert run(work, name, changed, temp, raw) == expected(work, temp, raw), fault.text
    assert refused >= 15


@COMPILERS
@pytest.mark.parametrize("name", ["Cortex-M3", "Cortex-M4F"])
def test_a_register_that_is_not_saved_is_found(work, listings, name: str) -> None:
    """A platform may reserve r9: here the code uses it in place of r8, and does not save it."""
    listing = Listing(listings[name])
    for instruction in [i for f in functions(work) for i in listing.of(f)]:
        if "sp!" not in instruction.operands:
            operands = tuple(re.sub(r"\br8\b", "r9", o) for o in instruction.operands)
            listing.replace(replace(instruction, operands=operands))
    with pytest.raises(UnprovenError, match="r9 is not left as it was"):
        proven(work, name, listing)


def test_what_is_not_covered_is_said(subjects) -> None:
    found = {name: compiled.not_covered(made.plan.shape) for name, made in subjects.items()}
    assert found[SHAPE] == ""
    assert "the inverse form" in found.values()
    assert "saturating results" in found.values()


@COMPILERS
def test_the_outcome(work: Workspace) -> None:
    outcome = compiled.check(work)
    assert outcome.result == PASSED, outcome
    assert set(outcome.figures["cores"]) == {core.name for core in CORES if core.counted}


def test_without_the_package_it_is_not_done(work, monkeypatch: pytest.MonkeyPatch) -> None:
    from triaxcal.verify.campaign import guarded

    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    outcome = guarded("compiled", "", lambda: compiled.check(work))
    assert outcome.result == NOT_DONE
    assert "triaxcal[proof]" in outcome.finding


def test_it_is_one_of_the_checks() -> None:
    assert "compiled" in [key for key, _, _ in CHECKS]
