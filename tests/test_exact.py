"""The exact error of one answer: against floats for every shape, and never beyond the proof."""

from __future__ import annotations

from random import Random

import numpy as np

from plans import COVERING, random_plan
from triaxcal.codegen.crosscheck import python_routine
from triaxcal.fixedpoint.exact import exact_error_lsb, exact_row
from triaxcal.fixedpoint.integer_model import STATUS_OK
from triaxcal.fixedpoint.plan import Plan
from triaxcal.fixedpoint.proof import prove

SAMPLES = 40
MOST_CODES = 100_000
"""Of a plan that every code can be tabulated of; the widest has half a thousand million."""


def moderate() -> list[tuple[str, Plan]]:
    found = {name: random_plan(Random(name), shape) for name, shape in COVERING.items()}
    found = {n: p for n, p in found.items() if p.temp_max_code - p.temp_min_code < MOST_CODES}
    assert {p.shape.inverse is None for p in found.values()} == {True, False}
    return list(found.items())


def test_exact_rows_are_those_of_the_plan() -> None:
    for name, plan in moderate():
        rows = plan.real_rows()
        for k in (0, len(rows) // 3, len(rows) - 1):
            code = plan.temp_min_code + k
            for axis in range(3):
                exact = np.array([float(v) for v in exact_row(plan, code, axis)])
                # Horner's rule and an inverse of condition < 100 in floats.
                np.testing.assert_allclose(rows[k, axis], exact, rtol=1e-12, err_msg=name)


def test_no_answer_is_beyond_the_proven_bound() -> None:
    """Corners of the raw box, where errors are largest; compared without any tolerance."""
    for name, plan in moderate():
        bound = prove(plan)
        rng = np.random.default_rng(7)
        codes = rng.integers(plan.temp_min_code, plan.temp_max_code + 1, SAMPLES)
        codes[0] = bound.temp_code
        ends = np.array([plan.shape.raw_min, plan.shape.raw_max])
        raw = ends[rng.integers(0, 2, (SAMPLES, 3))].astype(np.int32)
        answers, status = python_routine(plan)(codes.astype(np.int32), raw)
        for k in np.flatnonzero(status == STATUS_OK):
            for axis in range(3):
                error = exact_error_lsb(
                    plan, int(codes[k]), raw[k].tolist(), axis, int(answers[k, axis])
                )
                assert abs(error) <= bound.per_axis_lsb[axis], name
