"""Asymmetry of the gyros' scale factors: another one for each sense of rotation.

nu_i = e_i |w_i|: e_i is half of the difference of the scale factors for both senses.
"""

from __future__ import annotations

import numpy as np

from triaxcal.dynamic.blocks.base import PPM
from triaxcal.dynamic.blocks.block import AXIS, Signals, State, StateBlock, diagonal, extension
from triaxcal.model.types import FloatArray


def _rows(signals: Signals) -> FloatArray:
    return diagonal(np.abs(signals.rate))


BLOCK = StateBlock(
    "gyro-asymmetry",
    "asymmetry of the gyros' scale factors",
    tuple(State(f"aw{i}", "ppm", PPM, 1e4, f"asymmetry of gyro {AXIS[i]}") for i in (1, 2, 3)),
    rate=_rows,
)
ENTRY = extension(BLOCK, "The gyros' scale factors differ between both senses of rotation.")
