"""The thermometer lags behind the sensor while the chamber settles."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Parameter, Undo
from triaxcal.diagnosis.core.curves import constants
from triaxcal.diagnosis.core.readings import Readings
from triaxcal.model.types import FloatArray

_DWELLS = (1.0, 2.5, 6.0, np.inf)
"""Dwells in which the lag falls to 37 %; infinite, where the chamber never settles."""


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    if len(known.readings.blocks) < 2:
        return
    parameter = Parameter("lag at the first dwell of a temperature", "degC", 1.0, _steepest(known))
    one_way = len(np.unique(known.readings.rising)) == 1
    for dwells, settled in product(_DWELLS, (False, True)):
        if one_way and np.isinf(dwells):
            continue  # a shift of all temperatures
        yield Hypothesis(
            f"over {dwells:g} dwells" if np.isfinite(dwells) else "the same in all dwells",
            _caught_up(dwells, settled=settled),
            (parameter,),
            change="with the temperature of the sensor ahead of the thermometer",
            places=2.0 * len(_DWELLS),
            sizes=(0.3, 1.0, 3.0),
        )


def _steepest(known: Known) -> float:
    """Largest change of an output with temperature, g per degC, between neighbouring blocks."""
    temps = np.array(sorted(known.readings.block_degc(b) for b in known.readings.blocks))
    at = constants(known.theta, temps, known.readings.t0_degc)
    steps = np.maximum(np.diff(temps), 1.0)
    own = np.abs(np.diff(at[:, :, 0], axis=0)) + np.abs(
        np.diff(np.diagonal(at[:, :, 1:], axis1=1, axis2=2), axis=0)
    )
    return float((own / steps[:, None]).max())


def _caught_up(dwells: float, *, settled: bool) -> Undo:
    """Undo a lag; the first block may have settled before."""

    def undo(readings: Readings, amplitudes: FloatArray) -> Readings:
        ahead = amplitudes[0] * readings.rising * np.exp(-readings.order / dwells)
        if settled:
            ahead = np.where(readings.block == readings.blocks[0], 0.0, ahead)
        return readings.but(temps_degc=readings.temps_degc + ahead)

    return undo


ENTRY = Cause(
    name="lag",
    label="lag of the thermometer",
    doc="The thermometer is not as warm as the sensor while the chamber settles.",
    hypotheses=_hypotheses,
    apart="the first dwell of a temperature again when the chamber has settled",
    rank=62,
    spoils=True,
)
