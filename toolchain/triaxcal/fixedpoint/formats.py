"""Choosing formats: as many spare bits below the output LSB as provably fit, or a refusal."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fixedpoint.arithmetic import INT32_MAX, saturate_int32
from triaxcal.fixedpoint.inversion import (
    InverseShifts,
    adjugate,
    invert,
    quarter_determinant,
    reciprocal,
)
from triaxcal.fixedpoint.shape import Shape
from triaxcal.model.types import FloatArray, IntArray
from triaxcal.unit.choices import OUTPUT_Q_RANGE

MAX_SPARE_BITS = 16
MIN_SPARE_BITS = -4
"""Below this the gain's own last place costs more than 16 output LSB: a smaller Q says as much."""

_NAMES = tuple(
    f"{matrix}{row}{column}" if column else f"{offset}{row}"
    for matrix, offset in (("N", "b"), ("K", "U0"))
    for row in "xyz"
    for column in ("x", "y", "z", "")
)
FUNCTION_NAMES = {"direct": _NAMES[:12], "inverse": _NAMES[12:]}
"""Names of the twelve functions in image order."""


def choose_spare_bits(real: FloatArray, room: FloatArray, shape: Shape, where: str) -> int:
    """Largest number of spare bits with which the direct form fits.

    `real`, shape (segments, 12, order + 1), is in units of no spare bits, and so is `room`, shape
    (3,), what the offsets need besides. Of the
    plan's `shape` the output's format counts, but for the spare bits.

    Raises
    ------
    RefusedError
        Naming the row or the coefficient that does not fit, and the highest output_q that does.
    """
    stage = _stage_bounds(real)
    stage[3::4, 0] += room

    def fits(spare: int) -> bool:
        return _fits(stage * 2.0**spare, real.shape[2], spare, shape.row_limit)

    for spare in range(MAX_SPARE_BITS, MIN_SPARE_BITS - 1, -1):
        if fits(spare):
            return spare
    fitting = next((s for s in range(MIN_SPARE_BITS - 1, -40, -1) if fits(s)), None)
    raise _refusal(stage * 2.0**MIN_SPARE_BITS, shape, fitting, where)


def _stage_bounds(real: FloatArray) -> FloatArray:
    """Bound of |p_k| but for rounding, shape (12, order + 1), worst segment."""
    tails = np.cumsum(np.abs(real)[:, :, ::-1], axis=2)[:, :, ::-1]
    bounds: FloatArray = (tails * 2.0 ** np.arange(real.shape[2])).max(axis=0)
    return bounds


def _fits(stage: FloatArray, terms: int, spare: int, row_limit: int) -> bool:
    stage = stage + _rounding(terms)
    rows = _row_sums(stage) + 2.0 ** (spare + 1)
    return bool(stage.max() <= INT32_MAX and rows.max() < row_limit)


def _rounding(terms: int) -> float:
    """Most that rounded coefficients and floors add to a stage, and a term in dT/dt its own."""
    return terms + 4.0


def _row_sums(stage: FloatArray) -> FloatArray:
    final = stage[:, 0].reshape(3, 4)
    sums: FloatArray = final[:, :3].sum(axis=1) + 2 * final[:, 3]
    return sums


def _refusal(stage: FloatArray, shape: Shape, fitting: int | None, where: str) -> RefusedError:
    f, k = np.unravel_index(int(stage.argmax()), stage.shape)
    name = FUNCTION_NAMES["direct"][f]
    largest = _row_sums(stage).max() / 2.0 ** (MIN_SPARE_BITS + 1 + shape.output_q)
    culprit = (
        f"the declared raw range stands for {largest:.4g} {shape.unit}"
        if k == 0
        else f"the temperature coefficient of order {k} of {name} is too steep for the range"
    )
    return _does_not_fit(culprit, shape.output_q, fitting, where)


def _does_not_fit(culprit: str, output_q: int, fitting: int | None, where: str) -> RefusedError:
    """`fitting` is the number of spare bits, below `MIN_SPARE_BITS`, that would do."""
    remedy = "declare a narrower adc.code_min to adc.code_max"
    if fitting is not None:
        highest_q = output_q - (MIN_SPARE_BITS - fitting)
        if highest_q >= OUTPUT_Q_RANGE[0]:
            remedy = f"set compensation.output_q = {highest_q} or lower, or {remedy}"
    return RefusedError(
        where,
        f"{culprit}, which does not fit int32 at compensation.output_q = {output_q}",
        remedy=remedy,
    )


def choose_matrix_bits(real: FloatArray, where: str) -> int:
    """Largest power of two on K with which the inverse form's Horner steps fit int32.

    `real`, shape (segments, 12, order + 1), is K in raw LSB per g and U0 in raw LSB.

    Raises
    ------
    RefusedError
        When U0, which has no such power, does not fit.
    """
    room = INT32_MAX - _rounding(real.shape[2])
    stage = _stage_bounds(real)
    offset = stage[3::4]
    if offset.max() > room:
        row, k = np.unravel_index(int(offset.argmax()), offset.shape)
        name = FUNCTION_NAMES["inverse"][4 * row + 3]
        if k == 0 or np.abs(real[:, 3::4, 0]).max() > room:
            raise RefusedError(
                where,
                f"{name} lies beyond the declared raw range",
                remedy="check adc.full_scale_v, adc.code_min and adc.code_max",
            )
        raise RefusedError(
            where,
            f"the temperature coefficient of order {k} of {name} is too steep for the range",
            remedy='set compensation.method = "matrix", or a lower thermal.order',
        )
    matrix = np.delete(stage, np.s_[3::4], axis=0)
    return int(np.floor(np.log2(room / matrix.max())))


def choose_inverse(
    functions: IntArray, room: FloatArray, k_bits: int, shape: Shape, where: str
) -> tuple[InverseShifts, int]:
    """Shifts of the inversion and spare bits, from the integers at every temperature code.

    `functions`, shape (n, 3, 4), are K (times 2^k_bits raw LSB per g) and U0 (raw LSB).
    `room`, shape (3,), is what the offsets need besides, at no spare bits. Of the
    plan's `shape` the output's format counts, but for the spare bits.

    Raises
    ------
    RefusedError
        When K is so badly conditioned, or the output so fine, that nothing fits.
    """
    output_q = shape.output_q
    shifts, product_max = _shifts_of(functions[:, :, :3], where)
    for spare in range(MAX_SPARE_BITS, -40, -1):
        log2, determinant_shift = shifts.reciprocal_log2, shifts.determinant_shift
        gain_shift = log2 + 2 + determinant_shift - k_bits - (output_q + 32 + spare)
        if gain_shift < 1 or product_max >> gain_shift >= INT32_MAX:
            continue
        if gain_shift > 62:
            break
        shifts = replace(shifts, gain_shift=gain_shift)
        preload = replace(shape, output_shift=32 + spare).rounding_in_offset
        gain, offset = invert(functions, shifts, preload)
        offset = np.abs(offset) + np.ceil(room * 2.0**spare + 2.0 * shape.rate).astype(np.int64)
        rows = np.abs(gain).sum(axis=2) + 2 * offset
        if rows.max() >= shape.row_limit or offset.max() >= INT32_MAX:
            continue
        if spare >= MIN_SPARE_BITS:
            return shifts, spare
        largest = float(rows.max()) / 2.0 ** (spare + 1 + output_q)
        culprit = f"the declared raw range stands for {largest:.4g} {shape.unit}"
        raise _does_not_fit(culprit, output_q, spare, where)
    raise _does_not_fit("the declared raw range", output_q, None, where)


def _shifts_of(K: IntArray, where: str) -> tuple[InverseShifts, int]:
    """Shifts of the inversion but for that of the gains; the largest gain before that shift."""
    exact = adjugate(K)
    adjugate_shift = max(0, int(np.abs(exact).max()).bit_length() - 31)
    word = saturate_int32(exact >> adjugate_shift)
    quarter = quarter_determinant(K, word)
    determinant_shift = max(0, int(np.abs(quarter).max()).bit_length() - 31)
    least = int(np.abs(quarter >> determinant_shift).min())
    if least < 2**16:
        raise RefusedError(
            where,
            "K(T) is so near to singular that its inverse has fewer than 16 significant bits",
            remedy="look for axes that are not orthogonal, or for exchanged positions",
        )
    log2 = 62
    while (1 << log2) // least > INT32_MAX:
        log2 -= 1
    shifts = InverseShifts(adjugate_shift, determinant_shift, log2, 0)
    inverse = reciprocal(saturate_int32(quarter >> determinant_shift), shifts)
    product_max = int(np.abs(word * inverse[:, None, None]).max())
    return shifts, product_max
