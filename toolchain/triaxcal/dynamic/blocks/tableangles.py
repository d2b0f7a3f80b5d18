"""Mounting angles theta between instrument and plate, by the table's angle at rest, P2 (18)."""

from __future__ import annotations

from triaxcal.dynamic.blocks.base import ARCSEC
from triaxcal.dynamic.blocks.block import AXIS, Signals, State, StateBlock, extension, same
from triaxcal.model.types import FloatArray


def _rows(signals: Signals) -> FloatArray:
    return same(len(signals.force))


BLOCK = StateBlock(
    "table-angles",
    "mounting angles on the table",
    tuple(
        State(f"theta{i}", "arcsec", ARCSEC, 2e4, f"mounting angle about {AXIS[i]}")
        for i in (1, 2, 3)
    ),
    table=_rows,
    reset=True,
    needs="table_angle_rad",
)
ENTRY = extension(BLOCK, "Angles between unit and plate, by the table's angle at rest.")
