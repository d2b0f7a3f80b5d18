"""A second accelerometer triad at M, P2 (21), (22): three biases, a full matrix, its own delay.

The instrument's axes are those of the first triad, so the second has all nine elements. Its delay
is its own because its electronics are: with it the states of all blocks number 85.
"""

from __future__ import annotations

from dataclasses import replace

from triaxcal.dynamic.blocks.base import MM_PER_S2, element
from triaxcal.dynamic.blocks.block import (
    AXIS,
    Extension,
    Signals,
    State,
    StateBlock,
    bias_rows,
    spread,
)
from triaxcal.dynamic.blocks.delay import curve, rows
from triaxcal.model.types import FloatArray


def _matrix(signals: Signals) -> FloatArray:
    return spread(signals.force)


BIAS = StateBlock(
    "second-bias",
    "biases of the second accelerometer triad",
    tuple(
        State(
            f"df0_{i}", "mm/s^2", MM_PER_S2, 1000.0, f"bias of second accelerometer {AXIS[i - 3]}"
        )
        for i in (4, 5, 6)
    ),
    force2=bias_rows,
    needs="force2",
)
MATRIX = StateBlock(
    "second-matrix",
    "scale factors and misalignments of the second accelerometer triad",
    tuple(
        replace(element("Gamma", i, j, "second accelerometer {}"), name=f"Gamma{i + 3}{j}")
        for i in (1, 2, 3)
        for j in (1, 2, 3)
    ),
    force2=_matrix,
    needs="force2",
)
DELAY = StateBlock(
    "second-delay",
    "delay of the second accelerometer triad behind the gyros",
    (State("tau2", "ms", 1e-3, 20.0, "delay of the second triad"),),
    motion2=rows,
    motion_curve=curve,
    needs="force2",
)
ENTRY = Extension(
    "second-triad",
    "second accelerometer triad",
    "A second accelerometer triad with biases, a full matrix and a delay of its own.",
    (BIAS, MATRIX, DELAY),
)
