"""What is examined: a recording, the noise that is stated, and what was found from both."""

from __future__ import annotations

from dataclasses import dataclass

from triaxcal.dynamic.blocks import north
from triaxcal.dynamic.blocks.base import BASE
from triaxcal.dynamic.blocks.block import StateBlock
from triaxcal.dynamic.calibrate import DynamicResult
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.model.types import FloatArray


@dataclass(frozen=True)
class Case:
    """A recording and its solution.

    Attributes
    ----------
    recording : ImuRecording
    noise : DataSheet
    result : DynamicResult
    worst_sd : array, shape (n,), or None
        Of the states, the largest over the working range, where constants follow the temperature.
    """

    recording: ImuRecording
    noise: DataSheet
    result: DynamicResult
    worst_sd: FloatArray | None = None

    @property
    def chosen_blocks(self) -> tuple[StateBlock, ...]:
        """Blocks of the solution that [dynamic] blocks names: those that are always on are not."""
        return tuple(b for b in self.result.layout.blocks if b not in (*BASE, north.BLOCK))
