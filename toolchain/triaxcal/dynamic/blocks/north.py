"""Horizontal rate of the Earth where the heading is not known yet.

While nothing is known of the heading the Earth's horizontal rate is taken as zero, and its two
components in the level frame of the alignment are states. They enter linearly, so no first guess
is needed, and their estimate gives the heading. Not an effect of the unit: nuisance of the first
pass, new at each alignment.
"""

from __future__ import annotations

from triaxcal.dynamic.blocks.base import DEG_PER_H
from triaxcal.dynamic.blocks.block import State, StateBlock

BLOCK = StateBlock(
    "north",
    "horizontal rate of the Earth",
    tuple(State(f"u{i}", "deg/h", DEG_PER_H, 15.0, f"level component {i}") for i in (1, 2)),
)
