"""The images of the cross-check stand at every limit on both sides, and a wrong loader is found."""

from __future__ import annotations

from pathlib import Path

import pytest

from triaxcal.base.errors import RefusedError
from triaxcal.codegen.compiler import start_reference
from triaxcal.codegen.image_cases import check_images, image_cases
from triaxcal.codegen.image_layout import ROW_LIMIT, sum_of_floors
from triaxcal.codegen.routines import Generated, Reference, start_generated
from triaxcal.verify.shapes import SHAPES, Subject
from triaxcal.verify.workspace import IMAGE, Workspace
from verify.conftest import Planter

WRONG = [
    ("direct-two-segments", ">= ROW_LIMIT", "> ROW_LIMIT"),
    ("inverse", "u0) >= ROW_LIMIT)", "u0) > ROW_LIMIT)"),
    ("inverse", "(divisor < INT64_C(1073741825))", "(divisor < INT64_C(1073741824))"),
    ("saturating", "(bound / 2) + 1", "(bound / 2)"),
    ("saturating", "segment->gain > 0", "segment->gain >= 0"),
    ("direct-two-segments", "SEGMENTS_AT) != temp_min", "SEGMENTS_AT) < temp_min"),
    ("direct-two-segments", "last = next - 1;", "last = next;"),
]


def loaded(work: Workspace) -> tuple[Generated, Reference]:
    return (
        Generated(start_generated(work.folder, work.folder).load()),
        Reference(start_reference(work.folder).load()),
    )


@pytest.mark.parametrize("shape", list(SHAPES))
def test_both_sides_of_every_limit(subjects: dict[str, Subject], shape: str) -> None:
    made = subjects[shape]
    cases = image_cases(made.plan, made.files[IMAGE])
    for kind in ("c_0", "gain", "temp_max_code", "temp_min_code"):
        verdicts = {c.accepted for c in cases if c.name.startswith(kind)}
        assert verdicts == {True, False}, kind
    wild = [c.accepted for c in cases if c.name.startswith("wild")]
    # Quadratic terms leave the rows less room: there the wildest are refused.
    assert all(wild) or (made.plan.quadratic is not None and sum(wild) > len(wild) / 2)
    assert not any(c.accepted for c in cases if c.name.startswith(("bit of", "cut to")))
    rows = [(c.name, c.accepted) for c in cases if c.name.startswith("row")]
    if made.plan.shape.inverse is None:
        limit = made.plan.shape.row_limit
        assert {str(limit - 1) in name for name, accepted in rows if accepted} == {True}
        assert {str(limit) in name for name, accepted in rows if not accepted} == {True}
    else:
        # There a row depends on the temperature: the image is accepted, the state refused.
        names = [c.name for c in cases]
        for target in (ROW_LIMIT - 1, ROW_LIMIT):
            assert any(n.startswith(f"row at {target}, k_00") for n in names)
        least = made.plan.shape.inverse.determinant_min
        assert any(n.startswith(f"determinant {least - 1}") for n in names)
        assert any(n.startswith(f"determinant {least},") for n in names)


def test_floors() -> None:
    """B_k = floor(B_(k+1) / 2) + 1 from nothing: 1, 1, 1, ..."""
    assert [sum_of_floors(order) for order in range(4)] == [0, 1, 1, 1]


@pytest.mark.parametrize("shape", list(SHAPES))
def test_delivered_loader(plant: Planter, shape: str) -> None:
    work = plant(shape)
    assert check_images(work.plan, image_cases(work.plan, work.image), *loaded(work)) > 500


@pytest.mark.parametrize(("shape", "old", "new"), WRONG)
def test_a_wrong_loader_is_found(plant: Planter, shape: str, old: str, new: str) -> None:
    work = plant(shape, (old, new))
    with pytest.raises(RefusedError, match="image '"):
        check_images(work.plan, image_cases(work.plan, work.image), *loaded(work))


def test_a_loader_that_ignores_the_size_is_found(plant: Planter, tmp_path: Path) -> None:
    del tmp_path
    work = plant(
        "saturating", ("if ((size == TRIAX_IMAGE_SIZE) ||", "if ((size >= TRIAX_IMAGE_SIZE) ||")
    )
    with pytest.raises(RefusedError, match="too long"):
        check_images(work.plan, image_cases(work.plan, work.image), *loaded(work))
