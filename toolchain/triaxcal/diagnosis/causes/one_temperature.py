"""All readings of one temperature differ from what the other temperatures predict."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Parameter, Undo
from triaxcal.diagnosis.core.readings import Readings, rows_in_words
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray

_SYMPTOM = -4.0
"""Log probability against a cause that says why."""


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    readings = known.readings
    blocks = [b for b in readings.blocks if readings.test[readings.of_block(b)].all()]
    if len(blocks) < 3:
        return
    biases = tuple(Parameter(f"bias of {a}") for a in AXES)
    gains = tuple(Parameter(f"sensitivity of {a}", "%", 100.0) for a in AXES)
    for block in blocks:
        rows = readings.rows[readings.of_block(block)]
        yield Hypothesis(
            f"{readings.block_degc(block):.4g} degC ({rows_in_words(rows)})",
            _without(block),
            biases + gains,
            rows,
            f"without the change in {rows_in_words(rows)}",
            places=float(len(blocks)),
            log_prior=_SYMPTOM,
        )


def _without(block: int) -> Undo:
    def undo(readings: Readings, amplitudes: FloatArray) -> Readings:
        own = readings.of_block(block)[:, None]
        change = amplitudes[:3] + amplitudes[3:] * readings.force
        return readings.but(outputs=readings.outputs - np.where(own, change, 0.0))

    return undo


ENTRY = Cause(
    name="one_temperature",
    label="one temperature that stands out",
    doc="Biases and sensitivities of one temperature are others: a symptom, and no cause yet.",
    hypotheses=_hypotheses,
    apart="that temperature again; what the chamber, the supply and the thermometer did there",
    rank=72,
    symptom=True,
)
