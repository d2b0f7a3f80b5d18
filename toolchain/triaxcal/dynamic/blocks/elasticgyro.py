"""Elastic misalignment of the gyros' axes under load, P2 (20).

The three gyros are built alike. In gyro i's own axes (1, 2, 3) = instrument axes (i, i+1, i+2),
cyclic, a load f turns the sensing axis about its own axes 2 and 3 by psi_j = sum_i K_ij f_i / g, so
that it points along e1 + psi_3 e2 - psi_2 e3 and the gyro reads psi_3 w_2 - psi_2 w_3 too much.
This gives every element of the printed matrices that can be read.
"""

from __future__ import annotations

import numpy as np

from triaxcal.dynamic.blocks.base import ARCSEC
from triaxcal.dynamic.blocks.block import Signals, State, StateBlock, extension
from triaxcal.model.types import FloatArray


def _rows(signals: Signals) -> FloatArray:
    rows = np.zeros((len(signals.rate), 3, 6))
    for gyro in range(3):
        second, third = signals.rate[:, (gyro + 1) % 3], signals.rate[:, (gyro + 2) % 3]
        for along in range(3):
            load = signals.load[:, (gyro + along) % 3]
            rows[:, gyro, 2 * along] = -load * third
            rows[:, gyro, 2 * along + 1] = load * second
    return rows


BLOCK = StateBlock(
    "elastic-gyro",
    "elastic misalignment of the gyros",
    tuple(
        State(f"K{i}{j}", "arcsec/g", ARCSEC, 600.0, f"turn about own axis {j}, force along {i}")
        for i in (1, 2, 3)
        for j in (2, 3)
    ),
    rate=_rows,
)
ENTRY = extension(BLOCK, "A load turns the sensing axes of the gyros.")
