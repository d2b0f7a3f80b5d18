"""Vectors of the self-test on the device, and the answers of the integer model.

They are chosen by a fixed rule, in this order: samples on a border of rounding and one code beside
it; one raw code outside its limits at a time, all of them, two of them; corners of the raw range;
any codes in range. Temperatures go through both ends of the range, of every segment and of int32,
and what lies beside them. Which mutants of the routine they find is measured
(docs/explanation/verification.md).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from random import Random

import numpy as np

from triaxcal.codegen.forces import rate_edges
from triaxcal.codegen.ties import ties
from triaxcal.fixedpoint.arithmetic import INT32_MAX, INT32_MIN
from triaxcal.fixedpoint.integer_model import (
    STATUS_BAD_IMAGE,
    State,
    add_rate,
    apply,
    set_temperature,
)
from triaxcal.fixedpoint.plan import Plan
from triaxcal.model.types import IntArray

SEED = 20130530
VECTORS_SIZE = 1056
"""Bytes of flash for vectors; the rest of 2 KB is for the images."""
_TIES = 1
"""Borders of rounding for each axis."""


@dataclass(frozen=True)
class Vectors:
    """Codes of n samples: temperature and its rate (n,), raw and force (n, 3)."""

    temp: IntArray
    rate: IntArray
    raw: IntArray
    force: IntArray

    def __len__(self) -> int:
        return len(self.temp)


Sample = tuple[int, int, tuple[int, int, int], tuple[int, int, int]]
"""Temperature, rate, raw codes, force."""
_NO_FORCE = (0, 0, 0)


def vector_size(plan: Plan) -> int:
    """Bytes of a vector with its answer."""
    return 4 * (8 + (plan.rate is not None) + 3 * plan.shape.gyro)


def selftest_vectors(plan: Plan) -> Vectors:
    """The vectors of a plan: as many as fit `VECTORS_SIZE`."""
    chosen = list(itertools.islice(_samples(plan), VECTORS_SIZE // vector_size(plan)))
    temp, rate, raw, force = (np.array(column, np.int64) for column in zip(*chosen, strict=True))
    return Vectors(temp, rate, raw, force)


def _samples(plan: Plan) -> Iterator[Sample]:
    yield from _borders(plan)
    rng = Random(SEED)
    shape = plan.shape
    low, high = shape.raw_min, shape.raw_max
    temps = _temps(plan, rng)
    rates = _rates(plan, rng)
    forces = _forces(rng)

    def sample(raw: list[int]) -> Sample:
        x, y, z = (min(max(u, INT32_MIN), INT32_MAX) for u in raw)
        return next(temps), next(rates), (x, y, z), next(forces)

    def within() -> list[int]:
        return [rng.randint(low, high) for _ in range(3)]

    for axis, beyond in itertools.product(range(3), (low - 1, high + 1)):
        yield sample([beyond if axis == j else u for j, u in enumerate(within())])
    yield sample([INT32_MIN] * 3)
    yield sample([INT32_MAX] * 3)
    # Just beyond in two codes: a test of all three at once must not lose the bit that they share.
    yield sample([high + 1, high + 1, low])
    yield sample([low, high + 1, high + 1])
    for corner in ((low, high, high), (high, low, high), (high, high, low), (low, low, low)):
        yield sample(list(corner))
    while True:
        yield sample(within())


def _borders(plan: Plan) -> Iterator[Sample]:
    temp, raw = ties(plan, _TIES)
    for t, (x, y, z) in zip(temp.tolist(), raw.tolist(), strict=True):
        yield t, 0, (x, y, z), _NO_FORCE


def _temps(plan: Plan, rng: Random) -> Iterator[int]:
    low, high = plan.temp_min_code, plan.temp_max_code
    edges = [low, high, low - 1, high + 1, INT32_MIN, INT32_MAX]
    for segment in plan.segments[:8]:
        first, origin = segment.first_code, segment.origin_code
        edges += [origin, origin + 1, first - 1, first]
    edges = list(dict.fromkeys(edges))
    while True:
        for edge in edges:
            yield min(max(edge, INT32_MIN), INT32_MAX)
            yield rng.randint(low, high)


def _rates(plan: Plan, rng: Random) -> Iterator[int]:
    if plan.rate is None:
        yield from itertools.repeat(0)
        return
    low, high = plan.rate.min_code, plan.rate.max_code
    while True:
        for edge in rate_edges(plan.rate):
            yield edge
            yield rng.randint(low, high)


def _forces(rng: Random) -> Iterator[tuple[int, int, int]]:
    while True:
        x, y, z = (rng.randint(INT32_MIN, INT32_MAX) for _ in range(3))
        yield x, y, z
        x, y, z = (rng.choice((INT32_MIN, INT32_MAX)) for _ in range(3))
        yield x, y, z


def answers_of(plan: Plan, vectors: Vectors) -> tuple[IntArray, IntArray]:
    """Results (n, 3) and status (n,); also where constants have no usable inverse."""
    state, status = set_temperature(plan, vectors.temp)
    if plan.shape.inverse is not None:
        offset, flags = state.offset, np.zeros_like(status)
        if plan.rate is not None:
            offset, flags = add_rate(plan.rate, offset, vectors.rate)
        sums = np.abs(state.gain).sum(axis=2) + 2 * np.abs(offset)
        usable = (sums < plan.shape.row_limit).all(axis=1)
        state = State(state.gain * usable[:, None, None], offset * usable[:, None])
        status = status | flags | np.where(usable, 0, STATUS_BAD_IMAGE)
    elif plan.rate is not None:
        offset, flags = add_rate(plan.rate, state.offset, vectors.rate)
        state, status = State(state.gain, offset), status | flags
    result, flags = apply(plan, state, vectors.raw, vectors.force)
    return result, status | flags
