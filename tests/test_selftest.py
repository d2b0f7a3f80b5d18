"""The self-test of a delivery: its tables are right, small, and find what is wrong."""

from __future__ import annotations

import ctypes
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from builds import PROVENANCE, write_generated
from plans import GOLDEN
from triaxcal.base.errors import RefusedError
from triaxcal.codegen.names import names_of
from triaxcal.codegen.routines import start_generated
from triaxcal.codegen.selftest import TABLES_SIZE, check_selftest, render_selftest
from triaxcal.codegen.selftest_images import ENTRY_SIZE, selftest_images
from triaxcal.codegen.selftest_vectors import selftest_vectors, vector_size
from triaxcal.fixedpoint.plan import Plan

CONSTANTS = 65535


def build(plan: Plan, folder: Path, change: tuple[str, str, str] | None = None) -> ctypes.CDLL:
    """A delivery of the plan with its self-test; `change`: a file, a text, what replaces it."""
    write_generated(plan, folder)
    for name, text in render_selftest(plan, PROVENANCE).items():
        (folder / name).write_text(text)
    if change is not None:
        file, old, new = change
        path = folder / names_of(plan).file(file)
        text = path.read_text()
        assert old in text, old
        path.write_text(text.replace(old, new, 1))
    return start_generated(folder, folder, plan.prefix).load()


def answer(plan: Plan, library: ctypes.CDLL) -> int:
    function = getattr(library, f"{names_of(plan).linked}_01234567_selftest")
    function.restype = ctypes.c_uint32
    return int(function())


@pytest.mark.parametrize("name", sorted(GOLDEN))
def test_it_passes_within_2_kb(name: str, tmp_path: Path) -> None:
    plan = GOLDEN[name]
    check_selftest(plan, PROVENANCE, build(plan, tmp_path))
    text = render_selftest(plan, PROVENANCE)["triax_selftest.c"]
    vectors = selftest_vectors(plan)
    size = vector_size(plan) * len(vectors)
    images = selftest_images(plan, vectors, TABLES_SIZE - size - 64)
    size += sum(ENTRY_SIZE * (1 + len(image.changes)) for image in images)
    (told,) = re.findall(r"(\d+) bytes of tables", text)
    assert size + 60 <= int(told) <= TABLES_SIZE
    assert {bool(image.answers) for image in images} == {True, False}


def test_a_prefix_has_its_own_names(tmp_path: Path) -> None:
    plan = replace(GOLDEN["direct-checked"], prefix="left")
    texts = render_selftest(plan, PROVENANCE)
    assert set(texts) == {"left_selftest.h", "left_selftest.c"}
    assert not re.search(r"\btriax_", texts["left_selftest.c"])
    assert answer(plan, build(plan, tmp_path)) == 0


def test_a_changed_constant_has_a_number_of_its_own(tmp_path: Path) -> None:
    plan = GOLDEN["direct-checked"]
    value = int(plan.segments[0].coefficients[0, 0])
    assert answer(plan, build(plan, tmp_path, ("triax_calib.c", str(value), str(value + 1)))) == (
        CONSTANTS
    )


def test_the_first_wrong_vector_is_named_and_refused(tmp_path: Path) -> None:
    """The first temperature below the range is that of the first wrong answer."""
    plan = GOLDEN["direct-checked"]
    change = ("triax_comp.c", "status = TRIAX_STATUS_TEMP_LOW;", "status = TRIAX_STATUS_OK;")
    library = build(plan, tmp_path, change)
    low = selftest_vectors(plan).temp < plan.temp_min_code
    assert answer(plan, library) == int(np.flatnonzero(low)[0]) + 1
    with pytest.raises(RefusedError, match=r"triax_selftest on this machine: .*expected 0: passed"):
        check_selftest(plan, PROVENANCE, library)


def test_a_loader_that_takes_anything_fails_at_an_image(tmp_path: Path) -> None:
    plan = GOLDEN["direct-checked"]
    change = ("triax_comp.c", "#define ROW_LIMIT ", "#define ROW_LIMIT 2 * ")
    library = build(plan, tmp_path, change)
    vectors = len(selftest_vectors(plan))
    assert vectors < answer(plan, library) < CONSTANTS
