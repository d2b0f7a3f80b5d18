"""Three implementations must agree bit for bit, or nothing is delivered.

The Python integer model, the handwritten reference C (from the image) and the generated C (from
triax_calib.h, and from the image through triax_calib_load) answer the same vectors.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
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
    rng = np.random.Generator(np.random.PCG64(SEED))
    shape = plan.shape
    low, high = plan.temp_min_code, plan.temp_max_code
    # Sorted temperatures: set_temperature runs once for equal codes, as on the device.
    in_range = (
        np.sort(rng.integers(low, high, random_vectors, dtype=np.int32, endpoint=True)),
        rng.integers(
            shape.raw_min, shape.raw_max, (random_vectors, 3), dtype=np.int32, endpoint=True
        ),
    )
    anything = (
        np.sort(rng.integers(INT32_MIN, INT32_MAX, random_vectors, dtype=np.int32, endpoint=True)),
        rng.integers(INT32_MIN, INT32_MAX, (random_vectors, 3), dtype=np.int32, endpoint=True),
    )
    return [
        _lattice(plan),
        _boundary(plan),
        VectorSet("borders of rounding", *ties(plan)),
        VectorSet("random in range", *in_range),
        VectorSet("random int32", *anything),
    ]


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


def python_routine(plan: Plan) -> Routine:
    """The integer model as a routine: set_temperature once a code, then gathered."""
    states, _ = set_temperature(plan, plan.temp_codes)
    table = _columns(np.concatenate([states.gain, states.offset[:, :, None]], axis=2))

    def run(temp: Int32Array, raw: Int32Array) -> Answers:
        accel = np.empty((len(temp), 3), np.int32)
        status = np.empty(len(temp), np.uint32)
        for start in range(0, len(temp), _BLOCK):
            block = slice(start, start + _BLOCK)
            codes = temp[block].astype(np.int64)
            index = np.clip(codes, plan.temp_min_code, plan.temp_max_code) - plan.temp_min_code
            # One row for a whole block, as beyond the ends of the range, is broadcast.
            rows = _gather(table, index[:1] if (index == index[0]).all() else index)
            offset, flags = rows[:, :, 3], np.zeros(len(codes), np.int64)
            if plan.rate is not None:
                offset, flags = add_rate(plan.rate, offset, rates_of(plan.rate, codes))
            state = State(rows[:, :, :3], offset)
            # Axis by axis in memory, as the integer model works.
            axes = np.ascontiguousarray(raw[block].T, dtype=np.int64).T
            force = forces_of(temp[block], raw[block]) if plan.shape.gyro else None
            result, sample = apply(plan, state, axes, force)
            accel[block] = result
            low, high = codes < plan.temp_min_code, codes > plan.temp_max_code
            status[block] = flags | sample | low * STATUS_TEMP_LOW | high * STATUS_TEMP_HIGH
        return accel, status

    return run


def _columns(rows: NumberArray) -> NumberArray:
    """Table (12, codes) of rows (codes, 3, 4): whole columns are gathered several times faster."""
    return np.ascontiguousarray(rows.reshape(-1, 12).T)


def _gather(table: NumberArray, index: IntArray) -> NumberArray:
    """Rows (n, 3, 4) at `index`, as a view of gathered columns; "clip" is the fastest mode."""
    return np.take(table, index, axis=1, mode="clip").T.reshape(-1, 3, 4)


def cross_check(
    plan: Plan,
    sets: list[VectorSet],
    generated: Callable[[], Generated],
    reference: Callable[[], Routine],
    image: bytes,
) -> CrossCheck:
    """Run every vector through the three implementations and the image through the loader.

    `generated` and `reference` give the compiled C. They may wait for the compiler: Python answers
    meanwhile.

    Raises
    ------
    RefusedError
        At the first mismatch: its input and both outputs.
    """
    with ThreadPoolExecutor(2) as pool:
        compiled = (
            pool.submit(lambda: _answers(generated().run, sets)),
            pool.submit(lambda: _answers(reference(), sets)),
        )
        python = _answers(python_routine(plan), sets)
        largest = _largest_errors(plan, sets, python)
        for vectors, expected, *found in zip(
            sets, python, *(future.result() for future in compiled), strict=True
        ):
            _compare(vectors, "generated C", found[0], expected)
            _compare(vectors, "reference C", found[1], expected)
    boundary = next(v for v in sets if v.name == "boundaries")
    built = generated()
    loaded, answers = built.run_image(image, boundary.temp, boundary.raw)
    if loaded != STATUS_OK:
        raise RefusedError("triax_calib_load", f"refused its own image with status {loaded}")
    _compare(
        boundary,
        "generated C with the image",
        answers,
        generated().run(boundary.temp, boundary.raw),
    )
    return CrossCheck({v.name: len(v.temp) for v in sets}, largest)


def _answers(routine: Routine, sets: list[VectorSet]) -> list[Answers]:
    return [routine(v.temp, v.raw) for v in sets]


def _largest_errors(plan: Plan, sets: list[VectorSet], answers: list[Answers]) -> float:
    """Largest |integer - real| in LSB over the exhaustive sets."""
    real = _columns(plan.real_rows())
    errors = [
        _largest_error(plan, real, vectors, found)
        for vectors, found in zip(sets, answers, strict=True)
        if vectors.exhaustive
    ]
    return max(errors, default=0.0)


def _compare(vectors: VectorSet, name: str, found: Answers, expected: Answers) -> None:
    differs = difference(found, expected)
    if differs is None:
        return
    i = differs.first
    raise RefusedError(
        f"cross-check, vector {i} of '{vectors.name}'",
        f"temp_code {vectors.temp[i]}, raw_code {vectors.raw[i].tolist()}: {name} gives "
        f"{differs.found}",
        expected=differs.expected,
        remedy=f"{differs.count} of {len(vectors.temp)} vectors differ: do not use this build, "
        "report it",
    )


def _largest_error(plan: Plan, table: FloatArray, vectors: VectorSet, answers: Answers) -> float:
    """Largest |integer - real| in LSB over the vectors that no limit touched.

    Found in floats, whose rounding may reach 1e-6 LSB and more than the proven bound leaves; then
    computed exactly where it was found.
    """
    shape = plan.shape
    fraction = 2.0 ** (32 - shape.output_shift)
    clean = np.flatnonzero(answers[1] == STATUS_OK)
    found = [(0.0, -1)] * 3
    for start in range(0, len(clean), _BLOCK):
        chosen = clean[start : start + _BLOCK]
        rows = _gather(table, vectors.temp[chosen].astype(np.int64) - plan.temp_min_code)
        u = vectors.raw[chosen].astype(np.float64) * 2.0 ** (shape.raw_shift - 32)
        real = np.empty((3, len(chosen)))
        for i in range(3):
            real[i] = rows[:, i, 3]
            for j in range(3):
                real[i] += rows[:, i, j] * u[:, j]
        if plan.rate is not None:
            fullest = rates_of(plan.rate, vectors.temp[chosen]) * (plan.rate.gain / 2.0**32)
            real += plan.rate.real[:, None] * fullest
        if plan.real_quadratic is not None:
            real = real + plan.real_quadratic @ products(real.T).T * 2.0**-64
        if plan.real_sensitivity is not None:
            force = forces_of(vectors.temp[chosen], vectors.raw[chosen]).astype(np.float64)
            real += plan.real_sensitivity @ force.T * 2.0**-32
        for i in range(3):
            error = np.abs(answers[0][chosen, i] - real[i] * fraction)
            worst = int(error.argmax())
            found[i] = max(found[i], (float(error[worst]), int(chosen[worst])))
    return max(
        (
            abs(_exact_error(plan, vectors, v, i, int(answers[0][v, i])))
            for i, (_, v) in enumerate(found)
            if v >= 0
        ),
        default=0.0,
    )


def _exact_error(plan: Plan, vectors: VectorSet, v: int, axis: int, answer: int) -> float:
    temp, raw = vectors.temp[v : v + 1], vectors.raw[v : v + 1]
    rate = 0 if plan.rate is None else int(rates_of(plan.rate, temp)[0])
    force = forces_of(temp, raw)[0].tolist()
    return exact_error_lsb(
        plan, int(temp[0]), raw[0].tolist(), axis, answer, rate_code=rate, force_code=force
    )
