"""Direction of the table's axis while turning, P2 (15): its small angles kappa in the instrument.

For coarse units, whose azimuth drifts: the axis keeps its azimuth, which [table] states. The rows
are made in `channels`.
"""

from __future__ import annotations

from triaxcal.dynamic.block import Extension, State, StateBlock
from triaxcal.dynamic.blocks.base import ARCSEC

BLOCK = StateBlock(
    "rotation-axis",
    "angles of the table's axis in the unit",
    tuple(State(f"kappa{i}", "arcsec", ARCSEC, 2e4) for i in (2, 3)),
    reset=True,
    needs="table",
)
EXTENSION = Extension(BLOCK.name, BLOCK.title, (BLOCK,))
