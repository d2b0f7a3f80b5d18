"""The thermometer lags behind the sensor while the chamber settles."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Parameter, Undo
from triaxcal.diagnosis.core.readings import Readings
from triaxcal.model.types import FloatArray

_DWELLS = (1.0, 2.5, 6.0)
"""Dwells in which the lag falls to 37 %."""


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    if len(known.readings.blocks) < 2:
        return
    for dwells in _DWELLS:
        yield Hypothesis(
            f"over {dwells:g} dwells",
            _caught_up(dwells),
            (Parameter("lag at the first dwell of a temperature", "degC", 1.0),),
            change="with the temperature of the sensor ahead of the thermometer",
            places=float(len(_DWELLS)),
            sizes=(0.3, 1.0, 3.0, 10.0),
        )


def _caught_up(dwells: float) -> Undo:
    def undo(readings: Readings, amplitudes: FloatArray) -> Readings:
        ahead = amplitudes[0] * readings.rising * np.exp(-readings.order / dwells)
        return readings.but(temps_degc=readings.temps_degc + ahead)

    return undo


ENTRY = Cause(
    name="lag",
    label="lag of the thermometer",
    doc="The thermometer is not as warm as the sensor while the chamber settles.",
    hypotheses=_hypotheses,
    apart="the first dwell of a temperature again when the chamber has settled",
    rank=62,
)
