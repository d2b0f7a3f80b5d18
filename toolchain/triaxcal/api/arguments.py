"""What a caller gives with readings: temperatures in range, one value or one for each reading."""

from __future__ import annotations

from typing import Any

import numpy as np

from triaxcal.base.arrays import finite
from triaxcal.base.errors import RefusedError
from triaxcal.model.types import FloatArray


def temperatures(temp_degc: Any, range_degc: tuple[float, float] | None) -> FloatArray:
    """`temp_degc` as an array; refuses one outside of `range_degc`, where that is known."""
    temp = finite("temp_degc", temp_degc)
    low, high = range_degc or (-np.inf, np.inf)
    outside = np.argwhere((temp < low) | (temp > high))
    if len(outside):
        place = ", ".join(str(i) for i in outside[0].tolist())
        raise RefusedError(
            f"temp_degc[{place}]" if place else "temp_degc",
            f"found {temp[tuple(outside[0])]:g} degC",
            expected=f"{low:g} to {high:g} degC, the working range",
            remedy="calibrate over a wider range: the curves are not extrapolated",
        )
    return temp


def refuse_other_length(readings: FloatArray, **others: FloatArray) -> None:
    """Refuse what is neither one value nor one for each of the readings, shape (..., 3)."""
    count = readings.shape[:-1]
    for name, array in others.items():
        if array.ndim and array.shape != count:
            raise RefusedError(
                name,
                f"found the shape {array.shape}",
                expected=f"one value, or {count} as the readings have" if count else "one value",
            )
