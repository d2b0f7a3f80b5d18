"""Linear temperature coefficients of the accelerometers' biases and scale factors, P2 (23).

delta f_i = (k_i + K_ii f_i) dT, dT counted from the reference temperature. The recording's
temperature must change, and not in step with the turning.
"""

from __future__ import annotations

import numpy as np

from triaxcal.dynamic.blocks.base import MM_PER_S2, PPM
from triaxcal.dynamic.blocks.block import (
    AXIS,
    Signals,
    State,
    StateBlock,
    diagonal,
    extension,
    same,
)
from triaxcal.model.types import FloatArray


def rows(signals: Signals, values: FloatArray) -> FloatArray:
    """Rows of three k and three K that act on `values` (n, 3): shape (n, 3, 6)."""
    both: FloatArray = np.concatenate([same(len(values)), diagonal(values)], axis=2)
    return both * signals.delta_degc[:, None, None]


def _force(signals: Signals) -> FloatArray:
    return rows(signals, signals.force)


BLOCK = StateBlock(
    "accelerometer-thermal",
    "temperature coefficients of the accelerometers",
    (
        *(
            State(f"kdf{i}", "mm/s^2/degC", MM_PER_S2, 20.0, f"bias of accelerometer {AXIS[i]}")
            for i in (1, 2, 3)
        ),
        *(
            State(
                f"KGamma{i}{i}", "ppm/degC", PPM, 2000.0, f"scale factor of accelerometer {AXIS[i]}"
            )
            for i in (1, 2, 3)
        ),
    ),
    force=_force,
    needs="temp_degc",
)
ENTRY = extension(BLOCK, "Coefficients of the accelerometers' biases and scale factors.")
