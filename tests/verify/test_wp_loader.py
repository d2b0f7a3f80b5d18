"""WP on the loader: every goal of it is proven, and no planted mistake is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from random import Random

import pytest

from plans import COVERING, INT32_MAX, INT32_MIN, integer_shape, random_plan
from triaxcal.codegen.annotations import loader_not_covered
from triaxcal.codegen.names import names_of
from triaxcal.codegen.render import annotated_routine, specification
from triaxcal.fixedpoint.shape import Shape
from triaxcal.verify import wp
from triaxcal.verify.outcome import FAILED, PASSED
from triaxcal.verify.workspace import Workspace
from verify.conftest import needs
from verify.test_wp import nothing_known
from verify.test_wp_terms import plan_of
from verify.wp_cases import SPECIFICATION, C, plant, refuse_proof, workspace_of

__all__ = ["nothing_known"]

PROVERS = needs("frama-c", "why3", "cvc4", "z3")
SHAPE = integer_shape(order=2, segments=2)
LOADER = (
    "word_at", "int_at", "crc32", "horner_bound", "x_fits", "segment_fits", "terms_fit",
    "reach_of", "rate_fits", "read_function", "read_segment", "constants_fit", "identity_fits",
    "image_fits", "read_terms", "read_rate", "read_calib", "calib_check", "calib_load",
)  # fmt: skip
INVERSE = "inverse, three segments"
SHAPES = {
    "constants": integer_shape(order=0),
    "order 1": integer_shape(order=1),
    "order 1, three segments": integer_shape(order=1, segments=3),
    "order 2, two segments": SHAPE,
    "order 4": integer_shape(order=4),
    "order 5, two segments": integer_shape(order=5, segments=2),
    "sums of high words": integer_shape(order=2, segments=2, high_words=True),
    "saturating": integer_shape(order=3, output_shift=30, raw=(INT32_MIN, INT32_MAX)),
    INVERSE: COVERING["inverse-32-bit-three-segments"],
    "gyro, constants": replace(integer_shape(order=0), gyro=True),
    "gyro, cubic": replace(integer_shape(order=3), gyro=True),
    "gyro, two segments": replace(integer_shape(order=1, segments=2), gyro=True),
    "dT/dt, cubic": replace(integer_shape(order=3), rate=True),
    "dT/dt, two segments": replace(SHAPE, rate=True),
}
GYRO, RATE = "gyro, cubic", "dT/dt, two segments"


def workspace(shape: Shape, folder: Path) -> Workspace:
    """The routine of a shape, with constants that WP does not read."""
    plan = random_plan(Random(1), shape) if shape.inverse else plan_of(shape)
    return workspace_of(plan, folder)


@pytest.mark.parametrize("name", list(SHAPES))
def test_the_loader_has_contracts_where_it_is_covered(tmp_path: Path, name: str) -> None:
    shape = SHAPES[name]
    plan = workspace(shape, tmp_path / "work").plan
    assert not loader_not_covered(shape)
    present = wp.functions_of(annotated_routine(plan), names_of(plan).linked)
    others = set() if shape.gyro else {"terms_fit", "read_terms"}
    if not shape.rate:
        others |= {"reach_of", "rate_fits", "read_rate"}
    assert [name for name in present if name in LOADER] == [n for n in LOADER if n not in others]
    assert "accepted" in specification(plan, opaque=True)


@pytest.mark.parametrize(
    ("shape", "reason"),
    [
        (replace(SHAPE, order=6), "functions of order 6 and above"),
        (replace(SHAPE, quadratic=True), "quadratic terms"),
    ],
)
def test_the_loader_has_none_elsewhere(shape: Shape, reason: str) -> None:
    assert loader_not_covered(shape) == reason


@PROVERS
@pytest.mark.slow
@pytest.mark.parametrize("name", list(SHAPES))
def test_every_goal_of_the_loader_is_proven(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    functions_of = wp.functions_of
    monkeypatch.setattr(wp, "functions_of", lambda *a: [f for f in functions_of(*a) if f in LOADER])
    outcome = wp.check(workspace(SHAPES[name], tmp_path / "work"))
    assert outcome.result == PASSED, outcome
    assert {"calib_load", "read_segment", "lemmas"} <= set(outcome.figures["goals"])


FAULTS = {
    "a byte one bit too high": (C, "word_at", "p[2] << 16", "p[2] << 17"),
    "bytes exchanged": (C, "word_at", "(uint32_t)p[1] << 8", "(uint32_t)p[2] << 8"),
    "another CRC": (C, "crc32", "0xEDB88320u", "0xEDB88321u"),
    "seven bits of a byte": (C, "crc32", "bit < 8u", "bit < 7u"),
    "a CRC that is not inverted": (C, "crc32", "UINT32_MAX - crc", "crc"),
    "a bound one lower": (C, "horner_bound", "(bound / 2) + 1", "(bound / 2)"),
    "the smallest of the bounds": (C, "horner_bound", "bound > largest", "bound < largest"),
    "the nearer end": (C, "x_fits", "(below > above)", "(below < above)"),
    "a segment of one code": (C, "x_fits", "(first <= last)", "(first < last)"),
    "offsets counted once": (C, "segment_fits", "(2 * bound)", "bound"),
    "a row at its limit": (C, "segment_fits", "row_sum >= ROW", "row_sum > ROW"),
    "gain and origin exchanged": (
        C, "read_segment", "gain = int_at(image, at + 2u)", "gain = int_at(image, at + 1u)",
    ),
    "a segment that begins where the range does": (
        C, "constants_fit", "next > temp_min_code", "next >= temp_min_code",
    ),
    "the first code of the next": (C, "constants_fit", "last = next - 1", "last = next"),
    "the identity of another unit": (C, "identity_fits", "image, at - 1u", "image, at - 2u"),
    "a word of the header less": (
        C, "image_fits", "i < HEADER_WORDS; i++", "i < (HEADER_WORDS - 1u); i++",
    ),
    "an image of any size": (C, "image_fits", "(size == TRIAX_IMAGE_SIZE)", "(size != 0u)"),
    "the temperatures exchanged": (
        C, "read_calib", "->temp_max_code = int_at(image, HEADER_WORDS + 1u)",
        "->temp_max_code = int_at(image, HEADER_WORDS)",
    ),
    "constants not looked at": (C, "calib_check", "constants_fit(image) != 0u", "1u != 0u"),
    "what is refused is read": (C, "calib_load", "status == TRIAX", "status != TRIAX"),
    "what is refused changes the last word": (
        C, "calib_load", "read_calib(calib, image);",
        "read_calib(calib, image);\n} else {\n    calib->segment[1].coefficient[11][2] = 0;",
    ),
    "what is refused changes a code": (
        C, "calib_load", "read_calib(calib, image);",
        "read_calib(calib, image);\n} else {\n    calib->segment[1].origin_code = 0;",
    ),
    "specification: a byte one bit too low": (
        SPECIFICATION, "word_at", "1] << 8", "1] << 7",
    ),
    "specification: a CRC from nothing": (
        SPECIFICATION, "crc32", "n <= 0 ? 0xFFFFFFFF", "n <= 0 ? 0",
    ),
    "specification: another order": (
        SPECIFICATION, "image_fits", "word(image, 5) == 0x00000002", "word(image, 5) == 0x00000003",
    ),
    "specification: the first code of the next": (
        SPECIFICATION, "constants_fit", "s + 1) - 1 : max_code", "s + 1) : max_code",
    ),
    "specification: words one further": (
        SPECIFICATION, "read_segment", "segment_word(s) + 3 + f", "segment_word(s) + 4 + f",
    ),
    "specification: a lemma of constants that do not fit": (
        SPECIFICATION, "lemmas", "\\forall integer s; 0 <= s < n ==> segment_passes",
        "\\forall integer s; 1 <= s < n ==> segment_passes",
    ),
    "a word less of each function": (
        C, "read_function", "k <= (size_t)TRIAX_ORDER", "k < (size_t)TRIAX_ORDER",
    ),
    "words of the function before": (
        C, "read_segment", "at += (size_t)TRIAX_ORDER + 1u", "at += (size_t)TRIAX_ORDER",
    ),
}  # fmt: skip
OF_GYRO = {
    "a term not counted": (
        C,
        "terms_fit",
        "k < 3u; k++) {\n            row_sum",
        "k < 2u; k++) {\n            row_sum",
    ),
    "terms with their signs": (
        C,
        "terms_fit",
        "magnitude(int_at(image, TERMS_AT + (3u * i) + k))",
        "int_at(image, TERMS_AT + (3u * i) + k)",
    ),
    "terms one beyond the limit": (C, "terms_fit", "INT64_C(536870912)", "INT64_C(536870913)"),
    "terms of two rows": (
        C,
        "terms_fit",
        "i < 3u; i++) {\n        int64_t row_sum = 0;\n        size_t k",
        "i < 2u; i++) {\n        int64_t row_sum = 0;\n        size_t k",
    ),
    "terms not looked at": (C, "constants_fit", "terms_fit(image) == 0u", "fits == 2u"),
    "rows and columns exchanged": (
        C,
        "read_terms",
        "int_at(image, TERMS_AT + (3u * i) + k);",
        "int_at(image, TERMS_AT + (3u * k) + i);",
    ),
    "terms that are not read": (C, "read_calib", "    read_terms(calib, image);\n", ""),
    "specification: terms one word further": (
        SPECIFICATION,
        "read_terms",
        "= 69 + 3 * i + k",
        "= 70 + 3 * i + k",
    ),
    "specification: twice the room": (
        SPECIFICATION,
        "terms_fit",
        "i, 3) <= 536870912",
        "i, 3) <= 1073741824",
    ),
    "specification: any terms": (SPECIFICATION, "constants_fit", "&& terms_words_fit(image)", ""),
}
OF_INVERSE = {
    "a function that is not looked at": (
        C, "segment_fits", "j < 4u; j++) {\n            const", "j < 3u; j++) {\n            const",
    ),
    "a bound beyond int32": (C, "segment_fits", "bound > (int64_t)INT32_MAX", "bound < 0"),
    "a function of the row before": (
        C, "segment_fits", "coefficient[(4u * i) + j]", "coefficient[(3u * i) + j]",
    ),
    "specification: functions of two rows": (
        SPECIFICATION, "segment_fits", "row_passes(s, 4 * (n - 1))", "row_passes(s, 3 * (n - 1))",
    ),
}  # fmt: skip
OF_RATE = {
    "the smaller of two rates": (C, "reach_of", "return (below > above)", "return (below < above)"),
    "rates of one sign": (C, "rate_fits", "(rate_min_code <= 0) &&", "(rate_min_code < 0) &&"),
    "a rate of 2^31": (
        C, "rate_fits", "(reach * rate_gain) <= (int64_t)INT32_MAX",
        "(reach * rate_gain) <= INT64_C(2147483648)",
    ),
    "a row without its rate": (
        C, "segment_fits", "row_sum = 2 * ((magnitude(rate_offset[i]) / 2) + 1)", "row_sum = 0"
    ),
    "the rate of the first row": (
        C, "segment_fits", "magnitude(rate_offset[i])", "magnitude(rate_offset[0])"
    ),
    "an offset's word of another axis": (
        C, "constants_fit", "int_at(image, RATE_AT + 4u)", "int_at(image, RATE_AT + 3u)"
    ),
    "rates not looked at": (C, "constants_fit", "RATE_AT + 2u)) == 0u", "RATE_AT + 2u)) == 2u"),
    "least and greatest rate exchanged": (
        C, "read_rate", "rate_min_code = int_at(image, RATE_AT)",
        "rate_min_code = int_at(image, RATE_AT + 1u)",
    ),
    "an offset less": (
        C, "read_rate",
        "i < 3u; i++) {\n        calib->rate_", "i < 2u; i++) {\n        calib->rate_",
    ),
    "a rate that is not read": (C, "read_calib", "    read_rate(calib, image);\n", ""),
    "specification: no room for a rate": (
        SPECIFICATION, "lemmas", "s, 4, rate_bound(rate_word(image, 4)))", "s, 4, 0)",
    ),
    "specification: rates one word further": (
        SPECIFICATION, "read_rate", "c->rate_gain, P) == rate_word{L}(image, 2)",
        "c->rate_gain, P) == rate_word{L}(image, 3)",
    ),
    "specification: any rates": (SPECIFICATION, "constants_fit", "&& rate_words_fit(image)", ""),
}  # fmt: skip
FAULTS |= OF_GYRO | OF_INVERSE | OF_RATE
"""Text that has the mistake, function whose goals fail (or the lemmas), and the mistake."""


def shape_of(fault: str) -> str:
    """Name of the shape that a mistake is planted in."""
    of = {GYRO: OF_GYRO, INVERSE: OF_INVERSE, RATE: OF_RATE}
    return next((name for name, faults in of.items() if fault in faults), "order 2, two segments")


@PROVERS
@pytest.mark.slow
@pytest.mark.parametrize("name", list(FAULTS))
def test_a_planted_mistake_is_not_proven(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    text, function, old, new = FAULTS[name]
    work = workspace(SHAPES[shape_of(name)], tmp_path / "work")
    original = {C: annotated_routine, SPECIFICATION: specification}[text]
    assert str(original(work.plan, **({} if text == C else {"opaque": False}))).count(old) == 1

    if function != "lemmas":
        refuse_proof(work, monkeypatch, FAULTS[name])
        return
    plant(monkeypatch, text, old, new)
    monkeypatch.setattr(wp, "GOAL_S", 5)
    lemmas_of = wp.lemmas_of
    # A part without functions is one of lemmas; the last has those of the constants.
    monkeypatch.setattr(wp, "lemmas_of", lambda t: lemmas_of(t)[-1:])
    monkeypatch.setattr(wp, "functions_of", lambda *_: [])
    outcome = wp.check(work)
    assert outcome.result == FAILED
    assert "not proven: " in outcome.finding
