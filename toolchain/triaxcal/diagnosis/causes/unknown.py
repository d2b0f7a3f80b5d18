"""Something that is not in the list: the residuals are many times the stated noise."""

from __future__ import annotations

from collections.abc import Iterator

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, unchanged

_FACTORS = (4.5, 7.0, 11.0, 18.0, 40.0, 100.0, 250.0, 600.0, 1500.0, 4000.0, 10000.0, 25000.0)


def _hypotheses(_known: Known) -> Iterator[Hypothesis]:
    yield Hypothesis("", unchanged, change="nothing", noise=_FACTORS, log_prior=-3.0)


ENTRY = Cause(
    name="unknown",
    label="unknown",
    doc="No cause of the list explains the readings: they scatter far more than stated.",
    hypotheses=_hypotheses,
    apart="the same dwells again",
    discrete=True,
    rank=999,
)
