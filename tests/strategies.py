"""Hypothesis strategies shared by the tests."""

from __future__ import annotations

import string

import numpy as np
from hypothesis import strategies as st

from triaxcal.model.types import FloatArray

# Sizes of P1, tables 1 and 2: K_ii about -0.55 V/g, cross terms to 0.0164 V/g, U0 to 12 mV.
_SCALE_V_PER_G = st.floats(0.5, 0.6)
_CROSS_V_PER_G = st.floats(-0.0165, 0.0165)
_BIAS_V = st.floats(-0.012, 0.012)

_LETTERS_DIGITS = string.ascii_letters + string.digits


def unit_names() -> st.SearchStrategy[str]:
    """Legal names of units and serial numbers."""
    return st.builds(
        "".join,
        st.tuples(
            st.sampled_from(_LETTERS_DIGITS),
            st.text(alphabet=_LETTERS_DIGITS + "-_", max_size=63),
        ),
    )


@st.composite
def constants(draw: st.DrawFn) -> FloatArray:
    """Twelve passport constants, shape (12,), in the order of CONSTANT_NAMES."""
    sign = draw(st.sampled_from((-1.0, 1.0)))
    K = [[draw(_CROSS_V_PER_G) for _ in range(3)] for _ in range(3)]
    for i in range(3):
        K[i][i] = sign * draw(_SCALE_V_PER_G)
    return np.array([v for row in K for v in row] + [draw(_BIAS_V) for _ in range(3)])


def temperatures_degc() -> st.SearchStrategy[float]:
    """Temperatures of the working range of the shipped units."""
    return st.floats(-40.0, 70.0)


@st.composite
def forces_g(draw: st.DrawFn, magnitude_g: float = 1.0) -> FloatArray:
    """Specific force of a given magnitude in any direction, shape (3,)."""
    z = draw(st.floats(-1.0, 1.0))
    azimuth = draw(st.floats(0.0, 2.0 * np.pi))
    r = np.sqrt(1.0 - z * z)
    return magnitude_g * np.array([r * np.cos(azimuth), r * np.sin(azimuth), z])
