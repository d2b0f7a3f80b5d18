"""An output does not answer to the force."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, explained, unchanged
from triaxcal.diagnosis.core.curves import powers
from triaxcal.model.positions import AXES

_ANSWER = 0.05
"""Of the force: an output that changes by less does not answer."""
_BIAS_SD = np.array([0.5, 0.03, 5e-3, 2e-3, 1e-3])


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    readings = known.readings
    test = readings.test
    for i in range(3):
        own = readings.outputs[test, i]
        if np.ptp(own - np.median(own)) > 2 * _ANSWER:
            continue
        basis = powers(readings.temps_degc[test], readings.t0_degc) * _BIAS_SD
        covariance = basis @ basis.T + np.diag(np.maximum(2 * readings.sd[test, i], 5e-6) ** 2)
        _, log_det = np.linalg.slogdet(2 * np.pi * covariance)
        density = -0.5 * (log_det + own @ np.linalg.solve(covariance, own))
        unused = np.zeros((len(readings), 3), dtype=np.bool_)
        unused[test, i] = True
        yield Hypothesis(
            f"output {AXES[i]}",
            unchanged,
            rows=readings.rows,
            change=f"without output {AXES[i]}",
            places=3.0,
            unused=unused,
            log_density=explained(float(density), len(own)),
        )


ENTRY = Cause(
    name="dead",
    label="an output that does not answer",
    doc="An output stays the same in every position.",
    hypotheses=_hypotheses,
    apart="the unit turned by hand while the output is watched",
    discrete=True,
    rank=33,
)
