"""Three implementations must agree bit for bit, or nothing is delivered.

The Python integer model, the handwritten reference C (from the image) and the generated C (from
triax_calib.h, and from the image through triax_calib_load) answer the same vectors.
"""

from __future__ import annotations

import itertools
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeVar

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.codegen.forces import forces_of, rates_of
from triaxcal.codegen.routines import Answers, Generated, Int32Array, Routine, difference
from triaxcal.codegen.ties import ties
from triaxcal.fixedpoint.exact import exact_error_lsb
from triaxcal.fixedpoint.integer_model import (
    STATUS_OK,
    STATUS_TEMP_HIGH,
    STATUS_TEMP_LOW,
    State,
    add_rate,
    apply,
    set_temperature,
)
from triaxcal.fixedpoint.plan import Plan
from triaxcal.model.terms import products
from triaxcal.model.types import FloatArray, IntArray

NumberArray = TypeVar("NumberArray", IntArray, FloatArray)

INT32_MIN, INT32_MAX = -(2**31), 2**31 - 1
RANDOM_VECTORS = 1_000_000
SEED = 20130526
_SHARED_TEMP = 16  # random int32: raw codes a temperature, nearly all of which are out of range
_PART = 65536  # vectors that a thread puts to the three implementations at a time
_BLOCK = 8192  # of the Python model: its working arrays stay in the cache


@dataclass(frozen=True)
class VectorSet:
    """Named vectors: temperature codes (n,) and raw codes (n, 3).

    `exhaustive` sets reach every corner of the raw box at every temperature: the largest error is
    looked for there.
    """

    name: str
    temp: Int32Array
    raw: Int32Array
    exhaustive: bool = False


@dataclass(frozen=True)
class CrossCheck:
    """Result of a cross-check that found no mismatch.

    Attributes
    ----------
    vectors : dict
        Number of vectors by set.
    largest_error_lsb : float
        Largest error seen against the real-valued plan over the exhaustive sets, in output LSB.
    images : int
        Images that the loader rightly accepted or refused.
    """

    vectors: dict[str, int]
    largest_error_lsb: float
    images: int = 0

    @property
    def total(self) -> int:
        """Vectors in all."""
        return sum(self.vectors.values())


def vector_sets(plan: Plan, random_vectors: int = RANDOM_VECTORS) -> list[VectorSet]:
    """Every temperature code x lattice, a boundary grid, ties, random in range, random int32."""
    low, high = plan.temp_min_code, plan.temp_max_code
    # Sorted temperatures: set_temperature runs once for equal codes, as on the device.
    codes = np.arange(low, high + 1, dtype=np.int32)
    rng = np.random.Generator(np.random.PCG64(SEED))
    each = rng.multinomial(random_vectors, np.full(len(codes), 1.0 / len(codes)))
    in_range = _random_raw(random_vectors, plan.shape.raw_min, plan.shape.raw_max)
    sets = [
        _lattice(plan),
        _boundary(plan),
        VectorSet("borders of rounding", *ties(plan)),
        VectorSet("random in range", np.repeat(codes, each), in_range),
        _anything(random_vectors),
    ]
    return [vectors for vectors in sets if len(vectors.temp)]


@lru_cache(maxsize=2)
def _random_raw(count: int, low: int, high: int) -> Int32Array:
    """Raw codes (n, 3); the units of a series share them."""
    rng = np.random.Generator(np.random.PCG64([SEED, 1]))
    raw = rng.integers(low, high, (count, 3), dtype=np.int32, endpoint=True)
    raw.flags.writeable = False
    return raw


@lru_cache(maxsize=1)
def _anything(count: int) -> VectorSet:
    """Any int32; the units of a series share them."""
    rng = np.random.Generator(np.random.PCG64([SEED, 2]))
    temps = -(-count // _SHARED_TEMP)
    few = rng.integers(INT32_MIN, INT32_MAX, temps, dtype=np.int32, endpoint=True)
    temp = np.repeat(np.sort(few), _SHARED_TEMP)[:count]
    temp.flags.writeable = False
    return VectorSet("random int32", temp, _random_raw(count, INT32_MIN, INT32_MAX))


def _product(name: str, temp: list[int], raw_axis: list[int]) -> VectorSet:
    raw = np.array(list(itertools.product(raw_axis, repeat=3)), dtype=np.int32)
    temps = np.repeat(np.array(temp, dtype=np.int32), len(raw))
    return VectorSet(name, temps, np.tile(raw, (len(temp), 1)), exhaustive=True)


def _lattice(plan: Plan) -> VectorSet:
    """Every code of the range and two beyond each end x corners, faces, edges and centre."""
    temps = list(range(plan.temp_min_code - 2, plan.temp_max_code + 3))
    middle = (plan.shape.raw_min + plan.shape.raw_max) // 2
    raw = [plan.shape.raw_min, middle + 1, plan.shape.raw_max]
    return _product("every temperature code", temps, raw)


def _boundary(plan: Plan) -> VectorSet:
    """Around every limit of temperature, segment and raw code, and the ends of int32."""
    limits = {INT32_MIN, -1, 0, 1, INT32_MAX}
    edges = [plan.temp_min_code, plan.temp_max_code]
    edges += [s.first_code for s in plan.segments] + [s.origin_code for s in plan.segments]
    temps = limits | {e + d for e in edges for d in (-1, 0, 1)}
    raws = limits | {e + d for e in (plan.shape.raw_min, plan.shape.raw_max) for d in (-1, 0, 1)}
    return _product("boundaries", _within_int32(temps), _within_int32(raws))


def _within_int32(values: set[int]) -> list[int]:
    return sorted(v for v in values if INT32_MIN <= v <= INT32_MAX)


def python_routine(plan: Plan, rates: Int32Array | None = None) -> Routine:
    """The integer model as a routine: set_temperature once a code, then gathered.

    `rates` (n,) are the dT/dt of the vectors that it is called with; None is that of the campaign.
    """
    states, _ = set_temperature(plan, plan.temp_codes)
    table = _columns(np.concatenate([states.gain, states.offset[:, :, None]], axis=2))

    def run(temp: Int32Array, raw: Int32Array) -> Answers:
        accel = np.empty((len(temp), 3), np.int32)
        status = np.empty(len(temp), np.uint32)
        for start in range(0, len(temp), _BLOCK):
            block = slice(start, start + _BLOCK)
            codes = temp[block]
            clipped = np.clip(codes, plan.temp_min_code, plan.temp_max_code)
            index = clipped.astype(np.int64) - plan.temp_min_code
            # One row for a whole block, as beyond the ends of the range, is broadcast.
            rows = _gather(table, index[:1] if (index == index[0]).all() else index)
            offset, flags = rows[:, :, 3], np.zeros(1, np.int64)
            if plan.rate is not None:
                codes64 = codes.astype(np.int64)
                own = (
                    rates_of(plan.rate, codes64) if rates is None else rates[block].astype(np.int64)
                )
                offset, flags = add_rate(plan.rate, offset, own)
            state = State(rows[:, :, :3], offset)
            # Axis by axis in memory, as the integer model works.
            axes = np.ascontiguousarray(raw[block].T, dtype=np.int64).T
            force = forces_of(temp[block], raw[block]) if plan.shape.gyro else None
            result, sample = apply(plan, state, axes, force)
            accel[block] = result
            status[block] = flags | sample
            outside = np.flatnonzero(codes != clipped)
            if len(outside):
                low = codes[outside] < plan.temp_min_code
                status[block][outside] |= np.where(low, STATUS_TEMP_LOW, STATUS_TEMP_HIGH).astype(
                    np.uint32
                )
        return accel, status

    return run


def _columns(rows: NumberArray) -> NumberArray:
    """Table (12, codes) of rows (codes, 3, 4): whole columns are gathered several times faster."""
    return np.ascontiguousarray(rows.reshape(-1, 12).T)


def _gather(table: NumberArray, index: IntArray) -> NumberArray:
    """Rows (n, 3, 4) at `index`, as a view of gathered columns; "clip" is the fastest mode."""
    return np.take(table, index, axis=1, mode="clip").T.reshape(-1, 3, 4)


def cross_check(
    plan: Plan, sets: list[VectorSet], generated: Generated, reference: Routine, image: bytes
) -> CrossCheck:
    """Run every vector through the three implementations and the image through the loader.

    Raises
    ------
    RefusedError
        At the first mismatch: its input and both outputs.
    """
    python, real = python_routine(plan), _columns(plan.real_rows())

    def agreed(part: _Part) -> list[_Worst]:
        vectors, chosen = part.vectors, part.chosen
        temp, raw = vectors.temp[chosen], vectors.raw[chosen]
        expected = python(temp, raw)
        _compare(part, "generated C", generated.run(temp, raw), expected)
        _compare(part, "reference C", reference(temp, raw), expected)
        return _largest_errors(plan, real, temp, raw, expected) if vectors.exhaustive else []

    with ThreadPoolExecutor(2) as pool:
        errors = [worst for found in pool.map(agreed, _parts(sets)) for worst in found]
    _check_image(next(v for v in sets if v.name == "boundaries"), generated, image)
    # Floats find the vector, whose error is then computed exactly.
    largest = max(
        (
            _exact_error(plan, max(own, key=lambda worst: worst.error_lsb))
            for axis in range(3)
            if (own := [worst for worst in errors if worst.axis == axis])
        ),
        default=0.0,
    )
    return CrossCheck({v.name: len(v.temp) for v in sets}, largest)


@dataclass(frozen=True)
class _Part:
    """Some neighbouring vectors of a set."""

    vectors: VectorSet
    chosen: slice


@dataclass(frozen=True)
class _Worst:
    """The vector whose answer is furthest from the real-valued plan, in one axis, by floats."""

    error_lsb: float
    axis: int
    temp: int
    raw: tuple[int, int, int]
    answer: int


def _parts(sets: list[VectorSet]) -> list[_Part]:
    return [
        _Part(vectors, slice(start, start + _PART))
        for vectors in sets
        for start in range(0, len(vectors.temp), _PART)
    ]


def _check_image(boundary: VectorSet, generated: Generated, image: bytes) -> None:
    """The loader takes the image, and the routine then answers as with the header's constants."""
    loaded, answers = generated.run_image(image, boundary.temp, boundary.raw)
    if loaded != STATUS_OK:
        raise RefusedError("triax_calib_load", f"refused its own image with status {loaded}")
    expected = generated.run(boundary.temp, boundary.raw)
    whole = _Part(boundary, slice(0, len(boundary.temp)))
    _compare(whole, "generated C with the image", answers, expected)


def _compare(part: _Part, name: str, found: Answers, expected: Answers) -> None:
    differs = difference(found, expected)
    if differs is None:
        return
    vectors, i = part.vectors, part.chosen.start + differs.first
    raise RefusedError(
        f"cross-check, vector {i} of '{vectors.name}'",
        f"temp_code {vectors.temp[i]}, raw_code {vectors.raw[i].tolist()}: {name} gives "
        f"{differs.found}",
        expected=differs.expected,
        remedy=f"{differs.count} of {len(found[1])} vectors tried together differ: do not use "
        "this build, report it",
    )


def _largest_errors(
    plan: Plan, table: FloatArray, temp: Int32Array, raw: Int32Array, answers: Answers
) -> list[_Worst]:
    """Where |integer - real| is largest in each axis, over the vectors that no limit touched.

    In floats, whose rounding may reach 1e-6 LSB and more than the proven bound leaves.
    """
    clean = np.flatnonzero(answers[1] == STATUS_OK)
    found: list[_Worst] = []
    for start in range(0, len(clean), _BLOCK):
        chosen = clean[start : start + _BLOCK]
        real = _real_lsb(plan, table, temp[chosen], raw[chosen])
        for i in range(3):
            error = np.abs(answers[0][chosen, i] - real[i])
            worst = int(error.argmax())
            v = int(chosen[worst])
            x, y, z = raw[v].tolist()
            answer = int(answers[0][v, i])
            found.append(_Worst(float(error[worst]), i, int(temp[v]), (x, y, z), answer))
    return found


def _real_lsb(plan: Plan, table: FloatArray, temp: Int32Array, raw: Int32Array) -> FloatArray:
    """The real-valued plan's answers (3, n) in output LSB, temperatures in range."""
    rows = _gather(table, temp.astype(np.int64) - plan.temp_min_code)
    u = raw.astype(np.float64) * 2.0 ** (plan.shape.raw_shift - 32)
    real = np.empty((3, len(temp)))
    for i in range(3):
        real[i] = rows[:, i, 3]
        for j in range(3):
            real[i] += rows[:, i, j] * u[:, j]
    if plan.rate is not None:
        fullest = rates_of(plan.rate, temp) * (plan.rate.gain / 2.0**32)
        real += plan.rate.real[:, None] * fullest
    if plan.real_quadratic is not None:
        real = real + plan.real_quadratic @ products(real.T).T * 2.0**-64
    if plan.real_sensitivity is not None:
        real += plan.real_sensitivity @ forces_of(temp, raw).astype(np.float64).T * 2.0**-32
    return real * 2.0 ** (32 - plan.shape.output_shift)


def _exact_error(plan: Plan, worst: _Worst) -> float:
    temp, raw = np.array([worst.temp], np.int32), np.array([worst.raw], np.int32)
    rate = 0 if plan.rate is None else int(rates_of(plan.rate, temp)[0])
    force = forces_of(temp, raw)[0].tolist()
    lsb = exact_error_lsb(
        plan, worst.temp, list(worst.raw), worst.axis, worst.answer,
        rate_code=rate, force_code=force,
    )  # fmt: skip
    return abs(lsb)
