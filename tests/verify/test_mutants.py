"""Mutants are what they say, and the campaign tells killed from surviving."""

from __future__ import annotations

from pathlib import Path

import pytest

from triaxcal.codegen.names import Names
from triaxcal.verify import mutation
from triaxcal.verify.c_mutants import mutants_of
from triaxcal.verify.c_tokens import tokens_of
from triaxcal.verify.mutation import (
    BY_SANITIZER,
    KILLED,
    STILLBORN,
    SURVIVED,
    Bench,
    Equivalent,
)
from triaxcal.verify.mutation_selftest import SelftestBench
from triaxcal.verify.shapes import ALL_SHAPES, SHAPES, Subject, subject
from triaxcal.verify.workspace import ROUTINE, Workspace
from verify.conftest import UNITS

SOURCE = """#define LIMIT INT64_C(40) /* 41 */
static int32_t half(int32_t c[2][3], uint32_t i, uint32_t j)
{
    int32_t a = -c[i][j];
    if ((a < 3) && (i != 0u)) {
        a += 1;
    }
    return (a == 2) ? a : (int32_t)(~a >> 1);
}
"""


def test_tokens_are_the_whole_source_but_comments_and_spaces() -> None:
    tokens = tokens_of(SOURCE)
    assert all(SOURCE[t.start : t.end] == t.text for t in tokens)
    rest = SOURCE
    for token in reversed(tokens):
        rest = rest[: token.start] + rest[token.end :]
    assert rest.split() == []  # the comment belongs to the directive's line


@pytest.mark.parametrize("shape", list(SHAPES))
def test_tokens_of_the_generated_c(subjects: dict[str, Subject], shape: str) -> None:
    source = subjects[shape].files[ROUTINE].decode()
    kinds = {t.kind for t in tokens_of(source)}
    assert {"number", "name", "operator", "directive"} <= kinds


def test_what_no_token_starts_with() -> None:
    with pytest.raises(ValueError, match="no token"):
        tokens_of("int a = @;")


def changes() -> set[tuple[str, str, str]]:
    return {(m.function, m.before, m.after) for m in mutants_of(SOURCE)}


@pytest.mark.parametrize(
    ("function", "before", "after"),
    [
        ("LIMIT", "#define LIMIT INT64_C(40) /* 41 */", "#define LIMIT INT64_C(41) /* 41 */"),
        ("LIMIT", "#define LIMIT INT64_C(40) /* 41 */", "#define LIMIT INT64_C(39) /* 41 */"),
        ("half", "int32_t a = -c[i][j];", "int32_t a = c[i][j];"),
        ("half", "int32_t a = -c[i][j];", "int32_t a = -c[j][i];"),
        ("half", "int32_t a = -c[i][j];", "int32_t a = -c[j][j];"),
        ("half", "if ((a < 3) && (i != 0u)) {", "if ((a <= 3) && (i != 0u)) {"),
        ("half", "if ((a < 3) && (i != 0u)) {", "if ((a > 3) && (i != 0u)) {"),
        ("half", "if ((a < 3) && (i != 0u)) {", "if ((a < 3) || (i != 0u)) {"),
        ("half", "if ((a < 3) && (i != 0u)) {", "if ((a < 3) && (i == 0u)) {"),
        ("half", "if ((a < 3) && (i != 0u)) {", "if (!((a < 3) && (i != 0u))) {"),
        ("half", "if ((a < 3) && (i != 0u)) {", "if ((a < 3) && (i != 1u)) {"),
        ("half", "a += 1;", "a -= 1;"),
        ("half", "a += 1;", ";"),
        ("half", "a += 1;", "a += 2;"),
        ("half", "return (a == 2) ? a : (int32_t)(~a >> 1);",
         "return (a == 2) ? a : (int32_t)(a >> 1);"),
        ("half", "return (a == 2) ? a : (int32_t)(~a >> 1);",
         "return !(a == 2) ? a : (int32_t)(~a >> 1);"),
    ],
)  # fmt: skip
def test_mutants(function: str, before: str, after: str) -> None:
    assert (function, before, after) in changes()


def test_no_mutant_twice_none_the_original_no_size_of_an_array() -> None:
    sources = [m.source for m in mutants_of(SOURCE)]
    assert len(set(sources)) == len(sources)
    assert SOURCE not in sources
    assert all("c[2][3]" in s for s in sources)


def test_an_equivalent_covers_its_line_only() -> None:
    mutant = next(m for m in mutants_of(SOURCE) if m.after == "a -= 1;")
    entry = Equivalent("half", "a += 1;", ("a -= *~;",), "a reason", ("inverse",))
    assert entry.covers(mutant, "inverse")
    assert not entry.covers(mutant, "saturating")
    assert not Equivalent("other", "a += 1;", ("a -= 1;",), "r").covers(mutant, "inverse")
    assert not Equivalent("half", "a += 1;", ("a = 1;",), "r").covers(mutant, "inverse")


def test_every_equivalent_has_a_reason_and_known_shapes() -> None:
    for entry in mutation.read_equivalents(Names("triax", "accel", "01234567")):
        assert len(entry.reason) > 40
        assert set(entry.shapes) <= set(ALL_SHAPES)


@pytest.fixture(scope="module")
def bench(subjects: dict[str, Subject], tmp_path_factory: pytest.TempPathFactory) -> Bench:
    made = subjects["inverse"]
    folder = tmp_path_factory.mktemp("mutants")
    return Bench(Workspace.create(folder, made.files, made.plan, made.bound), "inverse")


@pytest.fixture(scope="module")
def selftest_bench(
    subjects: dict[str, Subject], tmp_path_factory: pytest.TempPathFactory
) -> SelftestBench:
    made = subjects["inverse"]
    folder = tmp_path_factory.mktemp("selftest_mutants")
    return SelftestBench(Workspace.create(folder, made.files, made.plan, made.bound), "inverse")


def fate(bench: Bench, folder: Path, old: str, new: str) -> str:
    source = (bench.work.folder / ROUTINE).read_text()
    assert old in source
    changed = next(
        (m for m in mutants_of(source) if m.source == source.replace(old, new, 1)), None
    ) or mutation.Mutant("planted", 0, old, new, source.replace(old, new, 1))
    del folder
    (verdict,) = mutation.judge_all(bench, [changed], ROUTINE)
    return verdict.fate


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("ux *= 256;", "ux *= 257;", KILLED),
        ("INT64_C(4294967288)", "INT64_C(4294967287)", KILLED),
        ("INT64_C(4294967288)", "INT64_C(4294967289)", KILLED),
        ("crc >> 1", "crc << 1", KILLED),
        ("for (i = 0u; i < size; i++) {", "for (i = 0u; i < size; i) {", KILLED),  # no end
        ("uint32_t fits = 0u;", "uint32_t fits = 0u", STILLBORN),
        ("uint32_t fits = 0u;", "uint32_t fits = 0u + 0u;", SURVIVED),
    ],
)
def test_fates(bench: Bench, tmp_path: Path, old: str, new: str, expected: str) -> None:
    assert fate(bench, tmp_path, old, new) == expected


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("ux *= 256;", "ux *= 257;", KILLED),
        ("for (i = 0u; i < size; i++) {", "for (i = 0u; i < size; i) {", KILLED),  # no end
        ("uint32_t fits = 0u;", "uint32_t fits = 0u", STILLBORN),
        ("uint32_t fits = 0u;", "uint32_t fits = 0u + 0u;", SURVIVED),
        ("for (j = 0u; j < 4u; j++) {", "for (j = 0u; j < 5u; j++) {", BY_SANITIZER),
    ],
)
def test_fates_by_the_self_test_alone(
    selftest_bench: SelftestBench, tmp_path: Path, old: str, new: str, expected: str
) -> None:
    assert fate(selftest_bench, tmp_path, old, new) == expected


@pytest.mark.parametrize(
    ("shape", "faults"),
    [
        ("rate", [
            ("status = TRIAX_STATUS_RATE_RANGE;", ";"),
            ("if (rate < calib->rate_min_code) {", "if (rate <= calib->rate_min_code) {"),
            ("INT64_C(2147483648)", "INT64_C(2147483649)"),
            ("INT64_C(2147483648)", "INT64_C(2147483647)"),
        ]),
        ("gyro", [
            ("times(k[2], force[2])", "times(k[2], force[1])"),
            ("sensitivity_sum(state->sensitivity[1], force)",
             "sensitivity_sum(state->sensitivity[2], force)"),
            ("INT64_C(536870912)", "INT64_C(536870913)"),
        ]),
    ],
)  # fmt: skip
def test_rates_and_forces_are_varied(
    tmp_path: Path, shape: str, faults: list[tuple[str, str]]
) -> None:
    made = subject(shape, UNITS)
    bench = Bench(Workspace.create(tmp_path, made.files, made.plan, made.bound), shape)
    source = (tmp_path / bench.work.named(ROUTINE)).read_text()
    for old, _ in faults:
        assert old in source, old
    planted = [
        mutation.Mutant("planted", 0, old, new, source.replace(old, new, 1)) for old, new in faults
    ]
    verdicts = mutation.judge_all(bench, planted, ROUTINE)
    assert [v.fate for v in verdicts] == [KILLED] * len(faults)


def test_an_equivalent_is_known_by_a_gyros_names() -> None:
    functions = {
        entry.function
        for entry in mutation.read_equivalents(Names("triax_gyro", "rate", "01234567"))
    }
    assert {"triax_gyro_apply", "TRIAX_GYRO_CALIB"} < functions
    assert not {"triax_apply", "TRIAX_CALIB"} & functions


@pytest.mark.slow
def test_every_word_of_the_image_matters(bench: Bench) -> None:
    verdicts = mutation.image_campaign(bench, every=7)
    assert len(verdicts) > 15
    assert {v.fate for v in verdicts} == {KILLED}


@pytest.mark.slow
def test_every_constant_matters(bench: Bench) -> None:
    verdicts = mutation.constants_campaign(bench, every=9)
    assert len(verdicts) > 8
    assert {v.fate for v in verdicts} == {KILLED}
