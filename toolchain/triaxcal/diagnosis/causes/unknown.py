"""Something that is not in the list: the residuals are many times the stated noise."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Undo, unchanged
from triaxcal.diagnosis.core.readings import Readings
from triaxcal.model.types import FloatArray

_FACTORS = (4.5, 7.0, 11.0, 18.0, 40.0, 100.0, 250.0, 600.0, 1500.0, 4000.0, 10000.0, 25000.0)
_OF_CHECKS = (4.0, 8.0, 16.0, 32.0, 64.0, 128.0)
_LAST = -3.0
"""Log probability against a cause that says why."""


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    yield Hypothesis("", unchanged, change="nothing", noise=_FACTORS, log_prior=_LAST)
    if known.readings.test.all():
        return
    for factor in _OF_CHECKS:
        yield Hypothesis(
            "in the check positions alone",
            _doubted(factor),
            change="nothing",
            places=float(len(_OF_CHECKS)),
            log_prior=_LAST,
        )


def _doubted(factor: float) -> Undo:
    def undo(readings: Readings, _amplitudes: FloatArray) -> Readings:
        return readings.but(sd=np.where(readings.test[:, None], readings.sd, readings.sd * factor))

    return undo


ENTRY = Cause(
    name="unknown",
    label="unknown",
    doc="No cause of the list explains the readings: they, or the checks, scatter far more.",
    hypotheses=_hypotheses,
    apart="the same dwells again",
    discrete=True,
    rank=999,
    symptom=True,
)
