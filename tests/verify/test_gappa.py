"""Gappa's bound: read rightly, above the exact one, tight, and sensitive to a wrong coefficient."""

from __future__ import annotations

import itertools
import struct
import zlib
from fractions import Fraction
from pathlib import Path

import pytest

from triaxcal.verify import gappa
from triaxcal.verify.image_reader import read_image
from triaxcal.verify.outcome import FAILED, NOT_DONE, PASSED
from triaxcal.verify.tools import BrokenToolError
from triaxcal.verify.workspace import IMAGE, Workspace
from verify.conftest import SHAPES_FAST_FIRST, Planter, needs


def test_interval_is_read_to_its_larger_end() -> None:
    text = (
        "Results:\n  a - z in [-950295959367685379b-60 {-0.82425, -2^(-0.278846)}, "
        "1046052418378842511b-60 {0.907306, 2^(-0.140339)}]\n"
    )
    assert gappa.largest_magnitude(text) == pytest.approx(0.907306, abs=1e-6)
    assert gappa.largest_magnitude(text.replace("-950", "-1950")) == pytest.approx(1.6916, abs=1e-3)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        (" a in [-1, 0]", 1.0),
        (" a in [1b-1 {0.5, 2^(-1)}, 1b-1 {0.5, 2^(-1)}]", 0.5),
        (" a in [-3b2 {-12, -2^(3.58)}, 1]", 12.0),
    ],
)
def test_other_intervals(text: str, value: float) -> None:
    assert gappa.largest_magnitude(text) == value


def test_bound_is_never_rounded_down() -> None:
    above = 2**60 + 1  # no double
    assert Fraction(gappa.largest_magnitude(f" a in [0, {above}]")) >= above


def test_no_interval_is_no_bound() -> None:
    with pytest.raises(BrokenToolError, match="gave no interval"):
        gappa.largest_magnitude("Error: cannot prove")


def test_a_floor_of_a_floor_is_the_floor() -> None:
    """What the script takes from fixed-point.md, step A: checked whole for small words."""
    for s, b, spare in itertools.product(range(-70, 70), range(-9, 9), range(4)):
        twice = (s // 16 + b) // 2**spare
        assert twice == (Fraction(s, 16) + b) // 2**spare


@needs("gappa")
@pytest.mark.parametrize("shape", SHAPES_FAST_FIRST[::2])
def test_bound_lies_above_the_exact_one(plant: Planter, shape: str) -> None:
    work = plant(shape)
    outcome = gappa.check(work)
    assert outcome.result == PASSED, outcome
    for found, exact in zip(outcome.figures["per_axis_lsb"], work.bound.per_axis_lsb, strict=True):
        assert found >= exact
    if shape == "direct-two-segments":
        # The bound asked for; an output 2^5 times finer has no final rounding to hide behind.
        assert outcome.figures["ratio_to_exact"] <= 1.2


@needs("gappa")
@pytest.mark.slow
def test_a_wrong_coefficient_in_the_image_shows(plant: Planter) -> None:
    work = plant("direct-two-segments")
    before = gappa.check(work).figures["per_axis_lsb"]
    words = list(struct.unpack(f"<{len(work.image) // 4}i", work.image))[:-1]
    words[17 + 3] += 4  # c_0 of Nxx on the first segment: 4 * 2^31 / 2^32 = 2 units, 1/4 LSB
    payload = struct.pack(f"<{len(words)}i", *words)
    (work.folder / IMAGE).write_bytes(payload + struct.pack("<I", zlib.crc32(payload)))
    after = gappa.check(work).figures["per_axis_lsb"]
    assert after[0] > before[0] + 0.1
    assert after[1:] == before[1:]


@needs("gappa")
@pytest.mark.slow
def test_a_bound_below_the_exact_one_fails(plant: Planter, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gappa, "largest_magnitude", lambda _: 0.5)
    outcome = gappa.check(plant("direct-two-segments"))
    assert outcome.result == FAILED
    assert "one is wrong" in outcome.finding


@needs("gappa")
def test_inverse_form_is_said_to_be_not_done(plant: Planter) -> None:
    outcome = gappa.check(plant("inverse"))
    assert outcome.result == NOT_DONE
    assert "inverse form" in outcome.finding


@needs("gappa")
def test_a_hint_that_gappa_cannot_check_is_refused(
    plant: Planter, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An identity that does not hold makes Gappa warn; then nothing is proven."""
    work = plant("direct-two-segments")
    render = type(work).render

    def wrong(self: Workspace, name: str, template: str, context: dict[str, object]) -> Path:
        path = render(self, name, template, context)
        path.write_text(path.read_text().replace("(a - y + 1b-1)", "(a - y + 1b-2)"))
        return path

    monkeypatch.setattr(type(work), "render", wrong)
    with pytest.raises(BrokenToolError, match="gappa"):
        gappa.check(work)


def test_image_is_read_by_the_page(plant: Planter) -> None:
    work = plant("direct-two-segments")
    image = read_image(work.image)
    plan = work.plan
    assert [s.first_code for s in image.segments] == [s.first_code for s in plan.segments]
    assert image.segments[0].last_code == plan.segments[1].first_code - 1
    assert image.segments[-1].last_code == plan.temp_max_code
    for found, planned in zip(image.segments, plan.segments, strict=True):
        assert [list(row) for row in found.coefficients] == planned.coefficients.tolist()
