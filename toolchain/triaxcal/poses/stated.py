"""Whether the readings of poses are in the unit that is stated for them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.types import FloatArray
from triaxcal.poses.steps import Steps
from triaxcal.unit.recording import RecordingLayout

_COUNTS_MIN = 50.0
"""Length of 1 g in counts: a code of a 50th of 1 g, 20 mg, is coarser than any sensor."""
NEAR = 1.6
"""Factor within which biases and scale errors leave what a sound sensor reads."""
_SIZES = {"m/s^2": 9.80665, "g": 1.0, "mg": 1e3}


def refuse_wrong_unit(
    source: str,
    readings: FloatArray,
    layout: RecordingLayout,
    steps: Steps | None = None,
    factors: Iterable[float] = (),
) -> None:
    """Refuse readings whose length is not near 1 g in the unit that is stated.

    The median over the poses: biases and scale errors stay far within a factor of two.

    Parameters
    ----------
    readings : array, shape (poses, 3)
    steps : Steps or None
        Of the recording; they tell codes from measured values.
    factors : iterable of float
        Lengths in 1 g, as stated, that are accepted beside 1.
    """
    one_g = layout.reading_of_1_g
    length = float(np.median(np.linalg.norm(readings, axis=1)))
    near = [u for u, size in _SIZES.items() if 0.7 * size <= length <= 1.4 * size]
    if one_g is None:
        _refuse_no_counts(source, layout, length, near)
        return
    if 0.5 * one_g <= length <= 2.0 * one_g or any(near_1(length / one_g / f) for f in factors):
        return
    codes = "" if steps is None or near else _codes(steps)
    if codes:
        remedy = 'these are counts: acceleration_unit = "count"'
    elif near:
        remedy = (
            f'{near[0]} taken for {layout.acceleration_unit}? then acceleration_unit = "{near[0]}"'
        )
    else:
        remedy = 'if these are raw codes, acceleration_unit = "count"'
    raise RefusedError(
        source,
        f"the readings are about {length:.4g} {layout.acceleration_unit} long{codes}",
        expected=f"about {one_g:g} at rest",
        remedy=remedy,
    )


def near_1(length_g: float) -> bool:
    """Whether a sound sensor may read this length at rest, in 1 g."""
    return 1.0 / NEAR < length_g < NEAR


def _codes(steps: Steps) -> str:
    """What shows that the readings are codes: whole numbers; "" where nothing does."""
    size = steps.size
    if not (steps.whole and (size >= 1.0).all()):
        return ""
    least = int(np.gcd.reduce(np.rint(size).astype(np.int64)))
    if least == 1:
        return ", and all are whole numbers"
    justified = ""
    if least & (least - 1) == 0:
        bits = least.bit_length() - 1
        justified = f": codes with {bits} empty bits at the right, as {16 - bits} bits in 16"
    return f", and all are multiples of {least}{justified}"


def _refuse_no_counts(source: str, layout: RecordingLayout, length: float, near: list[str]) -> None:
    """Refuse counts that are so small that they are none: a code would be a big step."""
    if layout.acceleration_unit != "count" or length > _COUNTS_MIN:
        return
    raise RefusedError(
        source,
        f"the readings are about {length:.4g} counts long",
        expected=f"more than {_COUNTS_MIN:g}: the firmware computes from whole counts",
        remedy=f'{near[0]} taken for counts? then acceleration_unit = "{near[0]}"'
        if near
        else "give the unit of the readings, acceleration_unit",
    )
