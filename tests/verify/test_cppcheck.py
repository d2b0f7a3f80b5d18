"""cppcheck's findings: placed rightly, deviations exactly those on file, a violation is found."""

from __future__ import annotations

import pytest

from triaxcal.verify import cppcheck
from triaxcal.verify.outcome import FAILED, PASSED
from verify.conftest import SHAPES_FAST_FIRST, Planter, needs

SOURCE = """#define LIMIT 3

static int32_t first(int32_t a)
{
    return a;
}

#define OTHER 4u /* macro */
uint32_t second(const state_t *state,
                int32_t b)
{
    return b;
}
"""


@pytest.mark.parametrize(
    ("line", "place"),
    [
        (1, "LIMIT"),
        (3, "first"),
        (5, "first"),
        (7, ""),
        (8, "OTHER"),
        (9, "second"),
        (12, "second"),
    ],
)
def test_place(line: int, place: str) -> None:
    assert cppcheck.place_of(SOURCE.splitlines(), line) == place


def test_a_deviation_covers_its_rule_in_its_places_only() -> None:
    deviation = cppcheck.Deviation("10.1", ("asr32",), "a reason")
    found = cppcheck.Finding("triax_comp.c", 3, "10.1", "asr32", "text")
    assert deviation.covers(found)
    assert not deviation.covers(cppcheck.Finding("triax_comp.c", 3, "10.1", "evaluate", "text"))
    assert not deviation.covers(cppcheck.Finding("triax_comp.c", 3, "10.4", "asr32", "text"))


def test_every_deviation_has_a_reason() -> None:
    assert all(len(d.reason) > 40 and d.places for d in cppcheck.read_deviations())


@needs("cppcheck")
@pytest.mark.parametrize("shape", SHAPES_FAST_FIRST)
def test_no_findings(plant: Planter, shape: str) -> None:
    outcome = cppcheck.check(plant(shape))
    assert outcome.result == PASSED, outcome.details


@needs("cppcheck")
@pytest.mark.parametrize(
    ("old", "new", "rule"),
    [
        ("INT64_C(4294967288)", "INT64_C(0xFFFFFFF8)", "7.2"),
        pytest.param(
            "uint32_t fits = 0u;",
            "uint32_t fits = (size != 0u) ? 1u : 0u;",
            "10.6",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "(int32_t)(value >> 32);",
            "(int32_t)(value >> 32); /* */ /* /* */",
            "3.1",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_a_violation_is_found(plant: Planter, old: str, new: str, rule: str) -> None:
    outcome = cppcheck.check(plant("direct-two-segments", (old, new)))
    assert outcome.result == FAILED
    assert any(f"MISRA {rule}" in detail for detail in outcome.details), outcome.details


@needs("cppcheck")
@pytest.mark.slow
def test_a_deviation_elsewhere_is_a_finding(plant: Planter) -> None:
    shifted = plant(
        "direct-two-segments", ("return c + high_word(", "return (c >> 1) + high_word(")
    )
    outcome = cppcheck.check(shifted)
    assert any("horner_step" in detail and "10.1" in detail for detail in outcome.details)
