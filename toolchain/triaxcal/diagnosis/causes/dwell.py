"""One dwell is wrong: moved, touched, recorded too early."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Parameter, shifted
from triaxcal.model.positions import AXES


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    readings = known.readings
    for k in known.odd_dwells:
        row = readings.rows[k]
        place = f"{readings.positions[k]} at {readings.temps_degc[k]:.4g} degC (row {row})"
        outputs = range(3) if readings.test[k] else [int(np.abs(readings.force[k]).argmax())]
        for i in outputs:
            yield Hypothesis(
                f"{place}, output {AXES[i]}",
                shifted(((int(row), i),)),
                (Parameter(f"output {AXES[i]}"),),
                np.array([row]),
                f"without {readings.positions[k]} of row {row}",
                places=4.0 * len(readings),
            )
        if readings.test[k]:
            yield Hypothesis(
                place,
                shifted(tuple((int(row), i) for i in range(3))),
                tuple(Parameter(f"output {a}") for a in AXES),
                np.array([row]),
                f"without {readings.positions[k]} of row {row}",
                places=4.0 * len(readings),
            )


ENTRY = Cause(
    name="dwell",
    label="one wrong dwell",
    doc="One dwell was disturbed: the unit moved, or had not come to rest.",
    hypotheses=_hypotheses,
    apart="the same position at the same temperature again",
    rank=10,
    spoils=True,
)
