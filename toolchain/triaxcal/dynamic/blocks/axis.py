"""Direction of the table's axis while turning, P2 (15): its small angles kappa in the instrument.

For coarse units, whose azimuth drifts: the axis keeps its azimuth, which [table] states. The rows
are made in `channels`.
"""

from __future__ import annotations

from triaxcal.dynamic.blocks.base import ARCSEC
from triaxcal.dynamic.blocks.block import AXIS, State, StateBlock, extension

BLOCK = StateBlock(
    "rotation-axis",
    "angles of the table's axis in the unit",
    tuple(
        State(f"kappa{i}", "arcsec", ARCSEC, 2e4, f"table's axis about {AXIS[i]}") for i in (2, 3)
    ),
    reset=True,
    needs="table",
)
ENTRY = extension(BLOCK, "The direction of the table's axis while it turns.")
