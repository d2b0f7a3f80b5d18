"""The readings are in another unit, or on another full scale, than stated."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.cause import Cause
from triaxcal.diagnosis.poses.core.cause import KnownPoses, PoseHypothesis, PoseUndo
from triaxcal.diagnosis.poses.core.readings import PoseReadings
from triaxcal.model.types import BoolArray, FloatArray
from triaxcal.poses.stated import near_1
from triaxcal.unit.recording import ACCELERATION_UNITS

POWERS = (2.0, 0.5, 4.0, 0.25)
"""Of another full scale or gain."""


def factors(one_g: float) -> dict[float, str]:
    """Lengths of readings in another unit or of another scale, in 1 g as stated, with the remedy.

    `one_g` is the reading of 1 g in the stated unit.
    """
    found = {
        size / one_g: f'with acceleration_unit = "{unit}"'
        for unit, size in ACCELERATION_UNITS.items()
        if size is not None and size != one_g
    }
    for factor in POWERS:
        found[factor] = f"with a full scale {1 / factor:g} times the stated one"
    return found


def divided(factor: float, some: BoolArray | bool = True) -> PoseUndo:
    """Undo a factor on some outputs: a mask that (n, 3) broadcasts with."""

    def undo(readings: PoseReadings, _amplitudes: FloatArray) -> PoseReadings:
        return readings.but(outputs=readings.outputs / np.where(some, factor, 1.0))

    return undo


def _hypotheses(known: KnownPoses) -> Iterator[PoseHypothesis]:
    readings = known.readings
    if not readings.nominal:
        return
    changes = factors(readings.one_g)
    length = float(np.median(np.linalg.norm(readings.outputs, axis=1))) / readings.gravity_g
    for factor, change in changes.items():
        if not near_1(length / factor):
            continue
        yield PoseHypothesis(
            f"they are {factor:.6g} times what they would be in {known.unit}",
            divided(factor),
            lines=readings.lines,
            change=change,
            places=float(len(changes)),
        )


ENTRY = Cause(
    name="scale",
    label="unit or scale of the readings",
    doc="The readings are in another unit, codes of another full scale, or in counts.",
    hypotheses=_hypotheses,
    apart="the settings of the sensor and of the logger",
    discrete=True,
    rank=36,
)
