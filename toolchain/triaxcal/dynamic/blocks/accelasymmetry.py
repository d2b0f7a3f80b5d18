"""Asymmetry of the accelerometers' scale factors: df_i = e_i |f_i|.

e_i is half of the difference of the scale factors for both signs of the force.
"""

from __future__ import annotations

import numpy as np

from triaxcal.dynamic.blocks.base import PPM
from triaxcal.dynamic.blocks.block import AXIS, Signals, State, StateBlock, diagonal, extension
from triaxcal.model.types import FloatArray


def _rows(signals: Signals) -> FloatArray:
    return diagonal(np.abs(signals.force))


BLOCK = StateBlock(
    "accelerometer-asymmetry",
    "asymmetry of the accelerometers' scale factors",
    tuple(
        State(f"af{i}", "ppm", PPM, 1e4, f"asymmetry of accelerometer {AXIS[i]}") for i in (1, 2, 3)
    ),
    force=_rows,
)
ENTRY = extension(BLOCK, "The accelerometers' scale factors differ between both signs of a force.")
