"""Each output has a term in the square of the force along its own axis."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Parameter
from triaxcal.diagnosis.core.readings import Readings
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray


def _hypotheses(_known: Known) -> Iterator[Hypothesis]:
    yield Hypothesis(
        "",
        _without,
        tuple(Parameter(f"square of {a}", "mg/g^2") for a in AXES),
        change="with the axes' own squares",
    )


def _without(readings: Readings, amplitudes: FloatArray) -> Readings:
    # In a check position the force is what the unit shows: three steps solve a + K2 a^2 = seen.
    seen = readings.force
    force = seen
    for _ in range(3):
        force = np.where(readings.test[:, None], seen, seen - amplitudes * force**2)
    return readings.but(outputs=readings.outputs - amplitudes * force**2)


ENTRY = Cause(
    name="own_square",
    label="own-axis squares of the sensor",
    doc="The sensor is not linear: its outputs have a term in the square of their own axis' force.",
    hypotheses=_hypotheses,
    apart="a dwell at 45 deg between two axes from squareness, which acts on all six positions",
    rank=40,
)
