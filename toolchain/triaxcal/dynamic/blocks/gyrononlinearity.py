"""Nonlinearity of the gyros' scale factors.

nu_i = q_i w_i^2 + o_i |w_i| w_i + c_i w_i^3: an even term, and two odd ones, because a scale factor
that changes with the rate does so in proportion to |w| or to w^2. The two odd terms need rates of
several sizes, and are known together where there are few.
"""

from __future__ import annotations

import numpy as np

from triaxcal.dynamic.blocks.base import PPM
from triaxcal.dynamic.blocks.block import AXIS, Signals, State, StateBlock, diagonal, extension
from triaxcal.model.types import FloatArray

DEG = np.pi / 180
TERMS = (
    ("qw", "ppm/(deg/s)", PPM / DEG, 100.0, "square of the rate, gyro"),
    ("ow", "ppm/(deg/s)", PPM / DEG, 100.0, "rate times its size, gyro"),
    ("cw", "ppm/(deg/s)^2", PPM / DEG**2, 1.0, "cube of the rate, gyro"),
)
"""Name, unit, its SI value, deviation beforehand, label."""


def _rows(signals: Signals) -> FloatArray:
    w = signals.rate
    return np.concatenate([diagonal(w**2), diagonal(np.abs(w) * w), diagonal(w**3)], axis=2)


BLOCK = StateBlock(
    "gyro-nonlinearity",
    "nonlinearity of the gyros",
    tuple(
        State(f"{name}{i}", unit, si, sd, f"{label} {AXIS[i]}")
        for name, unit, si, sd, label in TERMS
        for i in (1, 2, 3)
    ),
    rate=_rows,
)
ENTRY = extension(BLOCK, "The gyros' scale factors change with the rate.")
