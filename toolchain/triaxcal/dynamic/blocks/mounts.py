"""Torsional elasticity of the mounts, P2 (19): psi = theta + d f / g, without diagonal.

The unit is turned on its mounts by the load, but not about the load itself. Seen only against the
table's angle at rest, in different attitudes.
"""

from __future__ import annotations

from triaxcal.dynamic.blocks import tableangles
from triaxcal.dynamic.blocks.base import ARCSEC
from triaxcal.dynamic.blocks.block import AXIS, Signals, State, StateBlock, extension, spread
from triaxcal.model.types import FloatArray

_PLACES = ((0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1))


def _rows(signals: Signals) -> FloatArray:
    return spread(signals.load)[:, :, [3 * i + j for i, j in _PLACES]]


BLOCK = StateBlock(
    "mount-elasticity",
    "torsional elasticity of the mounts",
    tuple(
        State(
            f"d{i + 1}{j + 1}",
            "arcsec/g",
            ARCSEC,
            600.0,
            f"turn about {AXIS[i + 1]}, force along {AXIS[j + 1]}",
        )
        for i, j in _PLACES
    ),
    table=_rows,
    needs="table_angle_rad",
)
ENTRY = extension(BLOCK, "The unit turns on its mounts under load.", tableangles.BLOCK)
