"""Images in which the rounding of dT/dt decides a result.

Step D (docs/explanation/fixed-point.md) rounds r w / 2^32 half up. Planned words and the vectors'
rates meet that border nowhere, so that a half that is one off would not be seen.
"""

from __future__ import annotations

from collections.abc import Iterator

from triaxcal.codegen.image_layout import RATE_GAIN, RATE_MAX, RATE_MIN, RATE_WORDS, Layout
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
            layout.coefficient(s, 4 * row + j, k): -1 - half if (j, k) == (3, 0) else 0
            for s in range(layout.segments)
            for j in range(4)
            for k in range(layout.order + 1)
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
