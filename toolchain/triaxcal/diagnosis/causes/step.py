"""The biases stepped between two dates."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from triaxcal.diagnosis.causes.hysteresis import BIASES, biased
from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known
from triaxcal.diagnosis.core.readings import Readings
from triaxcal.model.types import BoolArray


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    readings = known.readings
    for block in readings.blocks[1:]:
        first = readings.rows[readings.of_block(block)].min()
        yield Hypothesis(
            f"before row {first} ({readings.block_degc(block):.4g} degC)",
            biased(_from(block)),
            BIASES,
            readings.rows[_from(block)(readings)],
            f"with one step of the biases before row {first}",
            places=len(readings.blocks) - 1.0,
        )


def _from(block: int) -> Callable[[Readings], BoolArray]:
    def side(readings: Readings) -> BoolArray:
        found: BoolArray = np.asarray(readings.block >= block)
        return found

    return side


ENTRY = Cause(
    name="step",
    label="a step of the biases between two dates",
    doc="From one row on all biases are others: a shock, a repair, another supply.",
    hypotheses=_hypotheses,
    apart="one of the first temperatures again at the end",
    rank=51,
    spoils=True,
)
