"""Outputs stand in each other's columns at some temperatures."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import permutations

import numpy as np

from triaxcal.diagnosis.core.blocks import Blocks, Struck, in_blocks, struck_some
from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Undo
from triaxcal.diagnosis.core.readings import Readings
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray

Order = tuple[int, ...]
_ORDERS: tuple[Order, ...] = tuple(p for p in permutations(range(3)) if p != (0, 1, 2))


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    readings = known.readings
    volts_per_g = readings.volts_per_g

    def reordered(outputs: FloatArray) -> FloatArray:
        return np.stack([(outputs * volts_per_g)[:, list(p)] / volts_per_g for p in _ORDERS])

    def described(order: Order, blocks: Blocks, where: str) -> Struck:
        names = ", ".join(f"{AXES[i]} as {AXES[order[i]]}" for i in range(3) if order[i] != i)
        change = f"with these columns in order {where}"
        return _reordered(order, blocks), f"{names} {where}", change

    # At all temperatures it is left-handed axes, or a turned sensor.
    return struck_some(readings, _ORDERS, reordered, described)


def _reordered(order: Order, blocks: Blocks) -> Undo:
    def undo(readings: Readings, _amplitudes: FloatArray) -> Readings:
        own, columns = in_blocks(readings, blocks)[:, None], list(order)
        scale = readings.volts_per_g[columns] / readings.volts_per_g
        return readings.but(
            outputs=np.where(own, readings.outputs[:, columns] * scale, readings.outputs),
            sd=np.where(own, readings.sd[:, columns] * np.abs(scale), readings.sd),
        )

    return undo


ENTRY = Cause(
    name="block_columns",
    label="columns exchanged at some temperatures",
    doc="Outputs stand in each other's columns in some blocks and not in the others.",
    hypotheses=_hypotheses,
    apart="wiring and columns at these temperatures",
    discrete=True,
    rank=54,
    spoils=True,
)
