"""Eva's report is read rightly, its ranges cover int32, and it complains of planted mistakes."""

from __future__ import annotations

from itertools import pairwise

import pytest

from triaxcal.codegen.names import Names
from triaxcal.fixedpoint.arithmetic import INT32_MAX, INT32_MIN
from triaxcal.verify import eva
from triaxcal.verify.mutation import read_equivalents
from triaxcal.verify.outcome import FAILED, PASSED
from triaxcal.verify.shapes import SHAPES, Subject
from triaxcal.verify.workspace import ROUTINE
from verify.conftest import SHAPES_FAST_FIRST, Planter, needs


def slow(*values: str) -> object:
    return pytest.param(*values, marks=pytest.mark.slow)


HEAD = "directory\tfile\tline\tfunction\tproperty kind\tstatus\tproperty\n"


def test_report() -> None:
    rows = [
        ".\ttriax_comp.c\t40\thorner_step\tsigned_overflow\tUnknown\tc + tmp <= 2147483647",
        ".\ttriax_comp.c\t41\thorner_step\tsigned_overflow\tValid\tc + tmp <= 2147483647",
        "FRAMAC_SHARE/libc\tstdint.h\t3\tf\tassigns clause\tUnknown\tassigns nothing",
        ".\tverify_eva.c\t28\tsample\tuser check\tInvalid or unreachable\t\\false",
        ".\tverify_eva.c\t44\tverify_codes\tuser check\tDead\t\\false",
    ]
    alarms, reached = eva.read_report(HEAD + "\n".join(rows))
    assert alarms == ["triax_comp.c:40: signed_overflow: c + tmp <= 2147483647"]
    assert reached == {"sample"}


@pytest.mark.parametrize("shape", list(SHAPES))
def test_ranges_are_int32_without_gap_or_overlap(subjects: dict[str, Subject], shape: str) -> None:
    ranges = eva.raw_ranges(subjects[shape].plan)
    assert ranges[0][0] == INT32_MIN
    assert ranges[-1][1] == INT32_MAX
    for (low, high), (following, _) in pairwise(ranges):
        assert low <= high
        assert following == high + 1


@needs("frama-c")
@pytest.mark.parametrize("shape", SHAPES_FAST_FIRST)
@pytest.mark.parametrize("check", [eva.check_codes, eva.check_codes_limbs, eva.check_image])
def test_no_alarms(plant: Planter, shape: str, check: object) -> None:
    outcome = check(plant(shape))  # type: ignore[operator]
    assert outcome.result == PASSED, outcome
    assert outcome.figures["alarms"] == 0


@needs("frama-c")
@pytest.mark.parametrize(
    ("shape", "old", "new", "kind"),
    [
        ("direct-two-segments", "return c + high_word(", "return 2 * c + high_word(", "overflow"),
        slow("inverse", "ux *= 256;", "ux *= 512;", "signed_overflow"),
        slow("saturating", "return (int32_t)result;", "return (int32_t)value;", "signed_downcast"),
        slow("saturating", "accel[2] = saturate32", "accel[3] = saturate32", "mem_access"),
    ],
)
def test_a_planted_mistake_gives_an_alarm(
    plant: Planter, shape: str, old: str, new: str, kind: str
) -> None:
    outcome = eva.check_codes(plant(shape, (old, new)))
    assert outcome.result == FAILED
    assert outcome.figures["alarms"] > 0
    assert any(kind in alarm for alarm in outcome.details), outcome.details


IDIOMS = [
    (entry.function, entry.before, after)
    for entry in read_equivalents(Names("triax", "accel", "01234567"))
    if "Eva gives an alarm" in entry.reason and entry.function != "asr64"
    for after in entry.after
]


@needs("frama-c")
@pytest.mark.slow
@pytest.mark.parametrize(("function", "before", "after"), IDIOMS)
def test_idioms_that_no_vector_can_test_on_this_host(
    plant: Planter, function: str, before: str, after: str
) -> None:
    """Mutants on file as equivalent, on the compilers at hand: Eva knows what C99 leaves open."""
    work = plant("direct-two-segments")
    text = (work.folder / ROUTINE).read_text()
    start = text.index(before, text.index(f"{function}("))
    (work.folder / ROUTINE).write_text(text[:start] + after + text[start + len(before) :])
    check = eva.check_image if function == "s32" else eva.check_codes
    assert check(work).figures["alarms"] > 0


@needs("frama-c")
@pytest.mark.slow
def test_a_read_beyond_the_image_gives_an_alarm(plant: Planter) -> None:
    wrong = plant("inverse", ("&image[4u * index]", "&image[(4u * index) + 5u]"))
    outcome = eva.check_image(wrong)
    assert outcome.result == FAILED
    assert any("mem_access" in alarm for alarm in outcome.details)


@needs("frama-c")
def test_silence_that_never_reached_the_end_is_no_success(plant: Planter) -> None:
    endless = plant(
        "inverse", ("uint32_t status = TRIAX_STATUS_OK;\n    int32_t ux",
                    "uint32_t status = TRIAX_STATUS_OK;\n    for (;;) {}\n    int32_t ux"),
    )  # fmt: skip
    outcome = eva.check_codes(endless)
    assert outcome.figures["alarms"] == 0
    assert outcome.result == FAILED
    assert "was not reached" in outcome.finding
