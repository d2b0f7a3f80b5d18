"""Linear temperature coefficients of biases and scale factors, P2 (23), (24).

delta f_i = (k_i + K_ii f_i) dT for the accelerometers and alike for the gyros, dT counted from the
reference temperature. The recording's temperature must change, and not in step with the turning.
"""

from __future__ import annotations

import numpy as np

from triaxcal.dynamic.block import Signals, State, StateBlock, diagonal, same
from triaxcal.dynamic.blocks.base import DEG_PER_H, MM_PER_S2, PPM
from triaxcal.model.types import FloatArray


def _rows(signals: Signals, values: FloatArray) -> FloatArray:
    rows: FloatArray = np.concatenate([same(len(values)), diagonal(values)], axis=2)
    return rows * signals.delta_degc[:, None, None]


def _force(signals: Signals) -> FloatArray:
    return _rows(signals, signals.force)


def _rate(signals: Signals) -> FloatArray:
    return _rows(signals, signals.rate)


def _states(names: tuple[str, str], unit: str, per_unit: float, prior: float) -> tuple[State, ...]:
    bias, scale = names
    return tuple(State(f"{bias}{i}", unit, per_unit, prior) for i in (1, 2, 3)) + tuple(
        State(f"{scale}{i}{i}", "ppm/degC", PPM, 2000.0) for i in (1, 2, 3)
    )


FORCE_BLOCK = StateBlock(
    "accelerometer-thermal",
    "temperature coefficients of the accelerometers",
    _states(("kdf", "KGamma"), "mm/s^2/degC", MM_PER_S2, 20.0),
    force=_force,
    needs="temp_degc",
)
RATE_BLOCK = StateBlock(
    "gyro-thermal",
    "temperature coefficients of the gyros",
    _states(("knu", "KTheta"), "deg/h/degC", DEG_PER_H, 1000.0),
    rate=_rate,
    needs="temp_degc",
)
