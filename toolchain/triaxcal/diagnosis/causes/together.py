"""No cause explains the readings alone, and two together do."""

from __future__ import annotations

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known

ENTRY: Cause[Known, Hypothesis] = Cause(
    name="together",
    label="two causes at once",
    doc="No cause explains the readings alone; two together do, best those that are named.",
    hypotheses=lambda _known: (),  # they are made of other causes that have been judged
    apart="the first of the two put right, and everything measured again",
    rank=900,
    symptom=True,
)
