"""A hundred million random vectors, the generated C against the integer model: nightly."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from triaxcal.codegen.crosscheck import SEED, python_routine
from triaxcal.codegen.routines import Generated, Int32Array, start_generated
from triaxcal.fixedpoint.plan import Plan
from triaxcal.targets.shapes import shipped_cases

UNITS = Path(__file__).parents[1] / "units"
SHAPES = ("cubic", "AT-CHERNIAK", "inverse", "saturating")
VECTORS = 100_000_000 // len(SHAPES)
BLOCK = 1_000_000


def block(plan: Plan, number: int) -> tuple[Int32Array, Int32Array]:
    """Of four vectors two are in range, one has any temperature code and one any int32 at all."""
    rng = np.random.Generator(np.random.PCG64([SEED, number]))
    temp = rng.integers(plan.temp_min_code, plan.temp_max_code, BLOCK, np.int32, endpoint=True)
    low, high = plan.shape.raw_min, plan.shape.raw_max
    raw = rng.integers(low, high, (BLOCK, 3), np.int32, endpoint=True)
    whole = np.iinfo(np.int32)
    half, quarter = BLOCK // 2, BLOCK // 4
    temp[half:] = rng.integers(whole.min, whole.max, half, np.int32, endpoint=True)
    raw[-quarter:] = rng.integers(whole.min, whole.max, (quarter, 3), np.int32, endpoint=True)
    return temp, raw


@pytest.mark.slow
@pytest.mark.parametrize("name", SHAPES)
def test_no_mismatch(name: str, tmp_path: Path) -> None:
    case = next(c for c in shipped_cases(UNITS) if c.name == name)
    for file, text in case.files.items():
        (tmp_path / file).write_text(text)
    generated = Generated(start_generated(tmp_path, tmp_path).load())
    expected = python_routine(case.plan)
    compared = mismatches = 0
    flags = np.uint32(0)
    for number in range(VECTORS // BLOCK):
        temp, raw = block(case.plan, number)
        accel, status = expected(temp, raw)
        found_accel, found_status = generated.run(temp, raw)
        mismatches += int(((accel != found_accel).any(axis=1) | (status != found_status)).sum())
        compared += len(temp)
        flags |= np.bitwise_or.reduce(status)
    assert (compared, mismatches) == (VECTORS, 0)
    assert flags & 3 == 3  # temperatures below and above the range were among them
