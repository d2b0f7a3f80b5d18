"""Images in which a term in dT/dt decides: its rounding, and its limits.

Step D (docs/explanation/fixed-point.md) rounds r w / 2^32 half up. Planned words and the vectors'
rates meet that border nowhere, so that a half that is one off would not be seen.
"""

from __future__ import annotations

from collections.abc import Iterator

from triaxcal.codegen.image_layout import (
    INT32_MAX,
    INT32_MIN,
    RATE_GAIN,
    RATE_MAX,
    RATE_MIN,
    RATE_WORDS,
    Layout,
    sum_of_floors,
)
from triaxcal.fixedpoint.shape import Shape

_PRODUCTS = {"just below a half": (1, 2**31 - 1), "a half": (2, 2**30)}
"""Factors of r w = 2^31 - 1, which rounds to 0, and of 2^31, which rounds to 1."""


def rate_ties(layout: Layout, shape: Shape) -> Iterator[tuple[str, dict[int, int]]]:
    """A name and the words to change, for each axis, border and sign of the rate.

    Rates are limited to one code, which the gain makes w. The row holds an offset alone, one below
    where the result of `triax_apply` steps up.
    """
    if not layout.rate or layout.inverse:
        return
    spare = shape.output_shift - 32
    half = 2 ** (spare - 1) if shape.quadratic and spare > 0 else 0
    for row in range(3):
        alone = {
            at: -1 - half if (f % 4, k) == (3, 0) else 0
            for _, f, k, at in layout.coefficients(range(4 * row, 4 * row + 4))
        }
        alone |= {layout.term(row, k): 0 for k in range(layout.columns)}
        alone |= {layout.rate_word(RATE_MIN): -1, layout.rate_word(RATE_MAX): 1}
        for name, (word, gain) in _PRODUCTS.items():
            for sign in (1, -1):
                words = {
                    layout.rate_word(RATE_WORDS + row): sign * word,
                    layout.rate_word(RATE_GAIN): gain,
                }
                yield f"{name} of row {row}, {sign:+d}", {**alone, **words}


def rate_edges(layout: Layout, words: list[int]) -> Iterator[tuple[str, dict[int, int]]]:
    """The range of rates about zero, its gain, and words that take a row to its limit."""
    if not layout.rate:
        return
    at = layout.rate_word
    for low, high in ((0, 0), (1, 1), (-1, -1), (0, INT32_MAX), (-INT32_MAX, 0), (INT32_MIN, 0)):
        yield f"rates {low} to {high}", {at(RATE_MIN): low, at(RATE_MAX): high, at(RATE_GAIN): 1}
    fastest = max(-words[at(RATE_MIN)], words[at(RATE_MAX)])
    fullest = INT32_MAX // fastest
    for gain in (INT32_MIN, -1, 0, 1, fullest, fullest + 1, INT32_MAX):
        yield f"gain {gain} of the rate", {at(RATE_GAIN): gain}
    for row in range(3):
        here = at(RATE_WORDS + row)
        for value in (INT32_MIN, -INT32_MAX, INT32_MAX):
            yield f"rate word {value} of row {row}", {here: value}
        nothing = {at: 0 for *_, at in layout.coefficients(range(4 * row, 4 * row + 4))}
        # The row is gains and 2 (b + |r| / 2 + 1): b takes what is left, some less and one more.
        left = (layout.row_limit - 1 - 5 * sum_of_floors(layout.order) - 2**31) // 2
        for b in (left - 3, left - 2, left - 1, left, left + 1):
            change = {**nothing, here: 2**31 - 2}
            change |= {layout.coefficient(s, 4 * row + 3, 0): b for s in range(layout.segments)}
            yield f"rate word and offset {b} of row {row}", change
