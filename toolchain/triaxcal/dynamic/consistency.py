"""Whether the innovations of the last pass are what the stated noise gives."""

from __future__ import annotations

import math

from triaxcal.dynamic.calibrate import DynamicResult

LEAST_RATIO, MOST_RATIO = 0.5, 1.1
"""Mean square of the innovations over that of the stated noise, where they agree."""


def verdict(result: DynamicResult) -> str:
    """Whether the innovations are what the stated noise gives; one sentence."""
    last = result.passes[-1]
    ratio = last.chi_square / last.freedom
    if ratio > MOST_RATIO:
        return (
            f"innovations {math.sqrt(ratio):.2f} times the stated noise: an effect is missing, or "
            "there is more noise than stated"
        )
    if ratio < LEAST_RATIO:
        return f"innovations {math.sqrt(ratio):.2f} times the stated noise: less noise than stated"
    return f"innovations {math.sqrt(ratio):.2f} times the stated noise: consistent"


def consistent(result: DynamicResult) -> bool:
    """Whether the innovations are what the stated noise gives."""
    last = result.passes[-1]
    return LEAST_RATIO <= last.chi_square / last.freedom <= MOST_RATIO
