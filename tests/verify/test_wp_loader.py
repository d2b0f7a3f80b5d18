"""WP on the loader: every goal of it is proven, and no planted mistake is."""

from __future__ import annotations

from pathlib import Path

import pytest

from plans import integer_shape
from triaxcal.codegen.annotations import loader_not_covered
from triaxcal.codegen.names import names_of
from triaxcal.codegen.render import annotated_routine, specification
from triaxcal.fixedpoint.shape import Shape
from triaxcal.verify import wp
from triaxcal.verify.outcome import FAILED
from verify.conftest import needs
from verify.test_wp import nothing_known
from verify.test_wp_codes import workspace
from verify.wp_cases import SPECIFICATION, C, plant

__all__ = ["nothing_known"]

PROVERS = needs("frama-c", "why3", "cvc4", "z3")
SHAPE = integer_shape(order=2, segments=2)
LOADER = (
    "word_at", "int_at", "crc32", "horner_bound", "x_fits", "segment_fits", "read_segment",
    "constants_fit", "identity_fits", "image_fits", "read_calib", "calib_check", "calib_load",
)  # fmt: skip


@pytest.mark.parametrize(
    ("shape", "reason"),
    [
        (SHAPE, ""),
        (integer_shape(order=0), ""),
        (integer_shape(order=1), "functions of order 1, 4 and above"),
        (integer_shape(order=4), "functions of order 1, 4 and above"),
    ],
)
def test_the_loader_has_contracts_where_it_is_covered(
    tmp_path: Path, shape: Shape, reason: str
) -> None:
    plan = workspace(shape, tmp_path / "work").plan
    assert loader_not_covered(shape) == reason
    text = annotated_routine(plan)
    present = wp.functions_of(text, names_of(plan).linked)
    assert [name for name in present if name in LOADER] == ([] if reason else list(LOADER))
    assert ("accepted" in specification(plan, opaque=True)) == (not reason)
    # The whole of the loader has them or nothing of it: no step of the proof is left alone.
    assert ("/*@" in text[text.index("uint32_t word_at") :]) == (not reason)


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
}  # fmt: skip
"""Text that has the mistake, function whose goals fail (or the lemmas), and the mistake."""


@PROVERS
@pytest.mark.slow
@pytest.mark.parametrize("name", list(FAULTS))
def test_a_planted_mistake_is_not_proven(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    text, function, old, new = FAULTS[name]
    work = workspace(SHAPE, tmp_path / "work")
    original = {C: annotated_routine, SPECIFICATION: specification}[text]
    assert str(original(work.plan, **({} if text == C else {"opaque": False}))).count(old) == 1

    plant(monkeypatch, text, old, new)
    monkeypatch.setattr(wp, "GOAL_S", 5)
    of_lemmas = function == "lemmas"
    lemmas_of = wp.lemmas_of
    # A part without functions is one of lemmas; the last has those of the constants.
    monkeypatch.setattr(wp, "lemmas_of", lambda t: lemmas_of(t)[-1:] if of_lemmas else [])
    monkeypatch.setattr(wp, "functions_of", lambda *_: [] if of_lemmas else [function])
    outcome = wp.check(work)
    assert outcome.result == FAILED
    assert "not proven: " in outcome.finding
