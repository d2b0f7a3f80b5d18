"""Several dwells are wrong at once."""

from __future__ import annotations

from collections.abc import Iterator
from math import comb

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Parameter, shifted
from triaxcal.diagnosis.core.readings import rows_in_words
from triaxcal.model.positions import AXES


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    readings = known.readings
    outputs = int(3 * readings.test.sum() + (~readings.test).sum())
    for count in range(2, len(known.standing_out) + 1):
        some = [(int(readings.rows[d]), i) for d, i in known.standing_out[:count]]
        rows = np.unique([row for row, _ in some])
        if len(rows) < 2:
            continue
        yield Hypothesis(
            rows_in_words(rows),
            shifted(tuple(some)),
            tuple(Parameter(f"row {row} output {AXES[i]}") for row, i in some),
            rows,
            f"without {rows_in_words(rows)}",
            places=5.0 * comb(outputs, count),
        )


ENTRY = Cause(
    name="dwells",
    label="several dwells that stand out",
    doc="Some dwells differ from the others, each in its own way: a symptom, and no cause yet.",
    hypotheses=_hypotheses,
    apart="the same dwells again",
    rank=11,
    symptom=True,
)
