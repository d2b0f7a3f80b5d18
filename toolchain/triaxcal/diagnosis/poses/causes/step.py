"""The biases stepped between two poses."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Parameter
from triaxcal.diagnosis.poses.core.cause import KnownPoses, PoseHypothesis, PoseUndo
from triaxcal.diagnosis.poses.core.readings import PoseReadings
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray

_LEAST = 2
"""Poses on either side: of one alone it is a wrong pose."""
_MOST_PLACES = 60
_SIZES_G = (0.5e-3, 5e-3, 50e-3)


def shifted(share: FloatArray) -> PoseUndo:
    """Undo shifts of the three outputs, by a share of the amplitudes in each pose, (n,)."""

    def undo(readings: PoseReadings, amplitudes: FloatArray) -> PoseReadings:
        return readings.but(outputs=readings.outputs - share[:, None] * amplitudes)

    return undo


def _hypotheses(known: KnownPoses) -> Iterator[PoseHypothesis]:
    readings = known.readings
    count = len(readings)
    if count < 2 * _LEAST:
        return
    places = np.unique(np.linspace(_LEAST, count - _LEAST, _MOST_PLACES).round().astype(int))
    after = np.arange(count)
    for k in places.tolist():
        yield PoseHypothesis(
            f"before {readings.words(np.array([k]))}",
            shifted((after >= k).astype(np.float64)),
            tuple(Parameter(f"output {axis}") for axis in AXES),
            readings.lines[k:],
            "with one step of the biases there",
            places=float(len(places)),
            sizes=_SIZES_G,
        )


ENTRY = Cause(
    name="step",
    label="a step of the biases",
    doc="From one pose on all biases are others: a shock, another supply, a restart of the sensor.",
    hypotheses=_hypotheses,
    apart="some of the first poses again at the end",
    rank=50,
    spoils=True,
)
