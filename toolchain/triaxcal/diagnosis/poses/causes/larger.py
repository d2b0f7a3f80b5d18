"""Constants are larger than [priors] says."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from triaxcal.diagnosis.core.cause import Cause
from triaxcal.diagnosis.poses.core.cause import KnownPoses, PoseHypothesis

_TIMES = 5.0
_WORDS = {
    "cross_term_rad": "cross terms of K",
    "scale_factor": "scale factors that differ",
    "own_square_g_per_g2": "own-axis squares",
    "product_g_per_g2": "products of two accelerations",
}


def _hypotheses(known: KnownPoses) -> Iterator[PoseHypothesis]:
    for key, words in _WORDS.items():
        value = _TIMES * getattr(known.priors, key)
        yield PoseHypothesis(
            words,
            lines=known.readings.lines,
            change=f"with [priors] {key} = {value:g}",
            places=float(len(_WORDS)),
            priors=replace(known.priors, **{key: value}),
        )


ENTRY = Cause(
    name="larger",
    label="constants larger than [priors] says",
    doc="Scale factors, cross terms or squares are far larger than [priors] says.",
    hypotheses=_hypotheses,
    apart="the data sheet of the sensor; more poses",
    discrete=True,
    symptom=True,
    rank=45,
)
