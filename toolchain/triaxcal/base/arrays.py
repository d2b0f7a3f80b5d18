"""Arrays that a caller gives: shape and values checked before anything is computed with them."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from triaxcal.base.errors import RefusedError


def finite(name: str, value: Any, columns: int | None = None) -> npt.NDArray[np.float64]:
    """`value` as finite floats, of shape (..., columns) where `columns` is given.

    Raises
    ------
    RefusedError
        For what is no array of numbers, another shape, or a value that is not finite.
    """
    array = _numbers(name, value)
    if columns is not None and (array.ndim == 0 or array.shape[-1] != columns):
        raise RefusedError(
            name, f"found the shape {array.shape}", expected=f"({columns},) or (n, {columns})"
        )
    found = array.astype(np.float64)
    bad = np.argwhere(~np.isfinite(found))
    if len(bad):
        raise _wrong(name, found, bad[0], "a finite number")
    return found


def int32(name: str, value: Any, columns: int | None = None) -> npt.NDArray[np.int32]:
    """`value` as int32, of shape (n, columns) where `columns` is given; nothing wraps around.

    Raises
    ------
    RefusedError
        As `finite`; for a number that is no whole number, or beyond int32.
    """
    array = _numbers(name, value)
    if array.dtype.kind == "f":
        array = array.astype(np.float64)  # as a float32, the largest int32 would round up
    if columns is not None and (array.ndim != 2 or array.shape[1] != columns):
        raise RefusedError(
            name, f"found the shape {array.shape}", expected=f"(n, {columns}), one row a reading"
        )
    with np.errstate(invalid="ignore"):
        whole = np.isfinite(array) & (array == np.rint(array)) if array.dtype.kind == "f" else True
        bad = np.argwhere(~(whole & (array >= -(2**31)) & (array <= 2**31 - 1)))
    if len(bad):
        raise _wrong(name, array, bad[0], "a whole number from -2147483648 to 2147483647")
    return array.astype(np.int32, order="C")


def _numbers(name: str, value: Any) -> npt.NDArray[Any]:
    if getattr(value, "mask", np.False_) is not np.False_ and np.any(value.mask):
        raise RefusedError(
            name, "found masked values", expected="a number in every place", remedy="leave them out"
        )
    try:
        array = np.asarray(value)
    except (ValueError, TypeError) as error:  # lists of uneven lengths
        raise RefusedError(name, f"no array: {error}", expected="an array of numbers") from error
    if array.dtype.kind not in "iuf":
        raise RefusedError(name, f"found an array of {array.dtype}", expected="an array of numbers")
    return array


def _wrong(
    name: str, array: npt.NDArray[Any], index: npt.NDArray[np.intp], expected: str
) -> RefusedError:
    place = ", ".join(str(i) for i in index.tolist())
    where = f"{name}[{place}]" if place else name
    return RefusedError(where, f"found {array[tuple(index)]}", expected=expected)
