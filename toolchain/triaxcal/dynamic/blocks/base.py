"""Biases, scale factors and misalignments of both triads, P2 (1), (2), (10).

f' - f = df0 + Gamma f with Gamma lower triangular (the instrument's first axis is that of
accelerometer 1, the second lies in the plane of accelerometers 1 and 2); w' - w = nu0 + Theta w.
With beta these are the 24 states of the base model. The priors only say that the unit works:
P2 asks for a unit whose errors are ten times smaller than what it measures.
"""

from __future__ import annotations

import numpy as np

from triaxcal.dynamic.blocks.block import AXIS, Signals, State, StateBlock, bias_rows, spread
from triaxcal.model.types import FloatArray

MM_PER_S2 = 1e-3
PPM = 1e-6
ARCSEC = np.pi / 180 / 3600
DEG_PER_H = np.pi / 180 / 3600
LOWER = ((0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2))
"""Elements of Gamma that are states, row by row."""


def element(name: str, i: int, j: int, sensor: str) -> State:
    """An element of the matrix of a triad, i and j from 1; `sensor` as "gyro {}".

    A misalignment in the plane of axes i and j is a turn about the third.
    """
    own = sensor.format(AXIS[i])
    if i == j:
        return State(f"{name}{i}{j}", "ppm", PPM, 1e5, f"scale factor of {own}")
    about = AXIS[6 - i - j]
    return State(f"{name}{i}{j}", "arcsec", ARCSEC, 2e4, f"misalignment of {own} about {about}")


def _gamma_rows(signals: Signals) -> FloatArray:
    return spread(signals.force)[:, :, [3 * i + j for i, j in LOWER]]


def _theta_rows(signals: Signals) -> FloatArray:
    return spread(signals.rate)


ACCELEROMETER_BIAS = StateBlock(
    "accelerometer-bias",
    "accelerometer biases",
    tuple(
        State(f"df0_{i}", "mm/s^2", MM_PER_S2, 1000.0, f"bias of accelerometer {AXIS[i]}")
        for i in (1, 2, 3)
    ),
    force=bias_rows,
)
ACCELEROMETER_MATRIX = StateBlock(
    "accelerometer-matrix",
    "accelerometer scale factors and misalignments",
    tuple(element("Gamma", i + 1, j + 1, "accelerometer {}") for i, j in LOWER),
    force=_gamma_rows,
)
GYRO_BIAS = StateBlock(
    "gyro-bias",
    "gyro drifts",
    tuple(
        State(f"nu0_{i}", "deg/h", DEG_PER_H, 36000.0, f"drift of gyro {AXIS[i]}")
        for i in (1, 2, 3)
    ),
    rate=bias_rows,
)
GYRO_MATRIX = StateBlock(
    "gyro-matrix",
    "gyro scale factors and misalignments",
    tuple(element("Theta", i, j, "gyro {}") for i in (1, 2, 3) for j in (1, 2, 3)),
    rate=_theta_rows,
)
BASE = (ACCELEROMETER_BIAS, ACCELEROMETER_MATRIX, GYRO_BIAS, GYRO_MATRIX)
