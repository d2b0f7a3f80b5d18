"""Linear temperature coefficients of the gyros' drifts and scale factors, P2 (24)."""

from __future__ import annotations

from triaxcal.dynamic.blocks.base import DEG_PER_H, PPM
from triaxcal.dynamic.blocks.block import AXIS, Signals, State, StateBlock, extension
from triaxcal.dynamic.blocks.thermal import rows
from triaxcal.model.types import FloatArray


def _rate(signals: Signals) -> FloatArray:
    return rows(signals, signals.rate)


BLOCK = StateBlock(
    "gyro-thermal",
    "temperature coefficients of the gyros",
    (
        *(
            State(f"knu{i}", "deg/h/degC", DEG_PER_H, 1000.0, f"drift of gyro {AXIS[i]}")
            for i in (1, 2, 3)
        ),
        *(
            State(f"KTheta{i}{i}", "ppm/degC", PPM, 2000.0, f"scale factor of gyro {AXIS[i]}")
            for i in (1, 2, 3)
        ),
    ),
    rate=_rate,
    needs="temp_degc",
)
ENTRY = extension(BLOCK, "Coefficients of the gyros' drifts and scale factors.")
