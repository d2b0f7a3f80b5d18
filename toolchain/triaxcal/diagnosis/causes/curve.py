"""The biases bend faster over temperature than the thermal functions can."""

from __future__ import annotations

from collections.abc import Iterator

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Parameter, Undo
from triaxcal.diagnosis.core.curves import BendFeatures
from triaxcal.diagnosis.core.readings import Readings
from triaxcal.model.types import FloatArray

_LENGTHS_DEGC = 8.0, 16.0
_SYMPTOM = -4.0
"""Log probability against a cause that says why: a sound sensor may bend, too."""


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    temps = known.readings.temps_degc
    for length in _LENGTHS_DEGC:
        features = BendFeatures(temps, length)
        if features.count < 3:
            continue
        yield Hypothesis(
            f"over {length:g} degC",
            _straightened(features),
            tuple(Parameter("bend") for _ in range(3 * features.count)),
            change="with a curve through every temperature",
            places=float(len(_LENGTHS_DEGC)),
            log_prior=_SYMPTOM,
            sizes=(0.6e-3, 2e-3, 6e-3, 20e-3),
        )


def _straightened(features: BendFeatures) -> Undo:
    def undo(readings: Readings, amplitudes: FloatArray) -> Readings:
        bends = features.at(readings.temps_degc) @ amplitudes.reshape(3, -1).T
        return readings.but(outputs=readings.outputs - bends)

    return undo


ENTRY = Cause(
    name="curve",
    label="a thermal curve that bends faster than the functions",
    doc="The biases have a bump or a jump over temperature that no low polynomial follows.",
    hypotheses=_hypotheses,
    apart="a dwell at a temperature between two measured ones",
    rank=70,
    symptom=True,
)
