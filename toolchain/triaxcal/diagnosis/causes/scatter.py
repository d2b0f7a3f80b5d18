"""The stated scatter of the readings is not theirs."""

from __future__ import annotations

from collections.abc import Iterator

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, unchanged

_SMALLER = (0.02, 0.04, 0.08, 0.15, 0.25)
_LARGER = (4.5, 7.0, 11.0, 18.0)


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    if not known.readings.stated:
        return
    for words, factors in (("smaller", _SMALLER), ("larger", _LARGER)):
        yield Hypothesis(
            f"the readings scatter {words} than stated",
            unchanged,
            change="with the scatter that the readings show",
            places=2.0,
            noise=factors,
        )


ENTRY = Cause(
    name="scatter",
    label="stated scatter that is not the readings'",
    doc="The standard deviations and counts of the file do not agree with the residuals.",
    hypotheses=_hypotheses,
    apart="one dwell repeated a few times, and the unit of the deviations",
    discrete=True,
    rank=80,
    symptom=True,
)
