"""The sensor has cubes of its axes' own acceleration, which no calibration of poses fits."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Parameter
from triaxcal.diagnosis.poses.core.cause import KnownPoses, PoseHypothesis
from triaxcal.diagnosis.poses.core.readings import PoseReadings
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray
from triaxcal.poses.stated import near_1


def _without(readings: PoseReadings, amplitudes: FloatArray) -> PoseReadings:
    return readings.but(outputs=readings.outputs - amplitudes * readings.outputs**3)


def _hypotheses(known: KnownPoses) -> Iterator[PoseHypothesis]:
    lengths = np.linalg.norm(known.readings.outputs, axis=1)
    if not near_1(float(np.median(lengths)) / known.readings.gravity_g):
        return  # its size is that of a sensor at 1 g
    yield PoseHypothesis(
        "",
        _without,
        tuple(Parameter(f"output {axis}", "mg/g^3") for axis in AXES),
        known.readings.lines,
        "with a cube of each axis' own acceleration",
        sizes=(0.5e-3, 5e-3, 50e-3),
    )


ENTRY = Cause(
    name="cubes",
    label="own-axis cubes of the sensor",
    doc="The sensor is not linear: its outputs have a term in the cube of their own acceleration.",
    hypotheses=_hypotheses,
    apart="more poses between the axes",
    rank=46,
)
