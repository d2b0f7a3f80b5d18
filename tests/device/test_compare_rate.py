"""Samples of a node whose calibration has a term in dT/dt, beside the integer model."""

from __future__ import annotations

import struct
from collections.abc import Iterator

import numpy as np
import pytest

from builds import write_generated
from test_rate import PLANS
from triaxcal.codegen.crosscheck import python_routine
from triaxcal.codegen.routines import routines_of, start_generated
from triaxcal.device.compare import Agreement, Samples, compare, take_samples

PLAN = PLANS["24 bits"]
COUNT = 400


class Recorded:
    """A link to a node that answers with samples one after the other."""

    name = "a node"

    def __init__(self, rows: Iterator[bytes]) -> None:
        self.rows = rows

    def read(self, extension: int, address: int, size: int) -> bytes:
        assert (extension, address, size) == (2, 0, 40)
        return next(self.rows)


@pytest.fixture(scope="module")
def samples(tmp_path_factory: pytest.TempPathFactory) -> Samples:
    """What the compiled C makes of codes and rates, the latter beyond their range too."""
    folder = tmp_path_factory.mktemp("rate")
    write_generated(PLAN, folder)
    library = start_generated(folder, folder).load()
    rng = np.random.default_rng(2)
    assert PLAN.rate is not None
    temp = rng.integers(PLAN.temp_min_code - 2, PLAN.temp_max_code + 2, COUNT, np.int32)
    rate = rng.integers(2 * PLAN.rate.min_code, 2 * PLAN.rate.max_code, COUNT, np.int32)
    raw = rng.integers(PLAN.shape.raw_min, PLAN.shape.raw_max, (COUNT, 3), np.int32)
    accel, status = routines_of(PLAN.rate, library, library, rate)[0].run(temp, raw)
    words = zip(temp, rate, raw, accel, status, strict=True)
    rows = [
        struct.pack("<Iii3i3iI", k, t, r, *u.tolist(), *a.tolist(), s)
        for k, (t, r, u, a, s) in enumerate(words)
    ]
    return take_samples(Recorded(iter(rows)), COUNT)  # type: ignore[arg-type]


def compared(samples: Samples) -> Agreement:
    return compare(samples, python_routine(PLAN, samples.rate), PLAN.shape.output_q)


def test_every_bit_is_that_of_the_model_at_the_rates_of_the_samples(samples: Samples) -> None:
    assert (samples.rate != 0).sum() > 0.9 * COUNT
    found = compared(samples)
    assert (found.samples, found.differing, found.largest_lsb) == (COUNT, 0, 0)
    assert found.flagged > 0.1 * COUNT


def test_a_node_that_leaves_the_rate_out_is_found(samples: Samples) -> None:
    nil = Samples(
        samples.temp, np.zeros_like(samples.rate), samples.raw, samples.accel, samples.status
    )
    assert compared(nil).differing > 0.9 * COUNT


def test_the_first_difference_names_the_rate(samples: Samples) -> None:
    accel = samples.accel.copy()
    accel[7, 1] += 1
    wrong = Samples(samples.temp, samples.rate, samples.raw, accel, samples.status)
    found = compared(wrong)
    assert (found.differing, found.largest_lsb) == (1, 1)
    assert found.first.startswith(
        f"sample 7, temp_code {samples.temp[7]}, rate_code {samples.rate[7]}, raw_code "
    )
