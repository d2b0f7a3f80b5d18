"""One output repeats another one."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import permutations

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, explained, unchanged
from triaxcal.model.positions import AXES

_LARGEST_G = 1e-3
_LEAST_SD_G = 2e-6


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    readings = known.readings
    test = readings.test
    volts = readings.outputs * readings.volts_per_g
    for i, j in permutations(range(3), 2):
        for sign in (1.0, -1.0):
            difference = (volts[test, i] - sign * volts[test, j]) / abs(readings.volts_per_g[i])
            if np.abs(difference).max() > _LARGEST_G or np.ptp(readings.outputs[test, j]) < 0.5:
                continue
            sd = max(float(np.sqrt(np.mean(difference**2))), _LEAST_SD_G)
            density = -0.5 * np.sum((difference / sd) ** 2 + np.log(2 * np.pi * sd**2))
            unused = np.zeros((len(readings), 3), dtype=np.bool_)
            unused[test, i] = True
            yield Hypothesis(
                f"output {AXES[i]} repeats output {AXES[j]}",
                unchanged,
                rows=readings.rows,
                change=f"without output {AXES[i]}",
                places=12.0,
                unused=unused,
                log_density=explained(float(density), len(difference)),
            )


ENTRY = Cause(
    name="copied",
    label="a copied output",
    doc="One output has the readings of another one: a column or a channel was read twice.",
    hypotheses=_hypotheses,
    apart="the wiring and the columns of the log",
    discrete=True,
    rank=34,
)
