"""Static analyser and sanitizers: silent on the delivered C, loud on planted mistakes."""

from __future__ import annotations

import pytest

from triaxcal.verify import analyzers
from triaxcal.verify.outcome import FAILED, PASSED
from triaxcal.verify.tools import Answer
from verify.conftest import SHAPES_FAST_FIRST, Planter, needs

CHECKS = [analyzers.check_gcc_sanitizers, analyzers.check_clang_sanitizers]


def test_complaints() -> None:
    text = (
        "x.c:3:5: runtime error: signed integer overflow\nfine\n"
        "==12==ERROR: AddressSanitizer: stack-buffer-overflow on address\n"
        "x.c:9:1: warning: leak of 'p' [CWE-401] [-Wanalyzer-malloc-leak]\n"
    )
    assert len(analyzers.complaints_of(Answer(1, text))) == 3
    assert not analyzers.complaints_of(Answer(0, "all is well\n"))


@needs("clang")
@pytest.mark.parametrize("shape", SHAPES_FAST_FIRST)
@pytest.mark.parametrize("check", CHECKS)
def test_delivered_c_is_clean(plant: Planter, shape: str, check: object) -> None:
    outcome = check(plant(shape))  # type: ignore[operator]
    assert outcome.result == PASSED, outcome.details
    assert outcome.figures["vectors"] > 400_000


@needs("clang")
@pytest.mark.parametrize("check", CHECKS)
@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("ux *= 256;", "ux *= 512;", "signed integer overflow"),
        (
            "accel[0] = apply_row(state->row[0]",
            "accel[0] = apply_row(state->row[1]",
            "answers differ",
        ),
    ],
)
def test_a_planted_mistake_is_found(
    plant: Planter, check: object, old: str, new: str, says: str
) -> None:
    outcome = check(plant("inverse", (old, new)))  # type: ignore[operator]
    assert outcome.result == FAILED
    assert any(any(word in detail for word in says.split("|")) for detail in outcome.details)


@needs("clang")
@pytest.mark.slow
def test_an_unsigned_wrap_that_is_not_meant_is_found(plant: Planter) -> None:
    wrong = plant("direct-two-segments", ("return ~crc;", "return 0u - (crc + 1u);"))
    outcome = analyzers.check_clang_sanitizers(wrong)
    assert outcome.result == FAILED
    assert any("unsigned integer overflow" in detail for detail in outcome.details)


def test_gcc_analyzer(plant: Planter) -> None:
    assert analyzers.check_gcc_analyzer(plant("inverse")).result == PASSED


def test_gcc_analyzer_finds_a_planted_mistake(plant: Planter) -> None:
    wrong = plant(
        "inverse",
        ("    const uint8_t *const p = &image[4u * index];",
         "    const uint8_t *const p = (index > 3u) ? &image[4u * index] : (const uint8_t *)0;"),
    )  # fmt: skip
    outcome = analyzers.check_gcc_analyzer(wrong)
    assert outcome.result == FAILED
    assert any("analyzer" in detail for detail in outcome.details)


@pytest.mark.slow
def test_a_write_out_of_bounds_is_found(plant: Planter) -> None:
    outcome = analyzers.check_gcc_sanitizers(
        plant("saturating", ("accel[2] = saturate32", "accel[3] = saturate32"))
    )
    assert outcome.result == FAILED
    assert any("AddressSanitizer" in d or "out of bounds" in d for d in outcome.details)
