"""Recordings of two units, where a function over temperature goes through whatever they are.

With two temperatures a straight line describes any two units. Biases and scale factors of one unit
do change over temperature. The angles between its sensing axes are those of its mounting, and
hardly do.
"""

from __future__ import annotations

import math

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.dynamic.temperatures import Recorded
from triaxcal.dynamic.thermalcurves import Known
from triaxcal.model.types import FloatArray

ANGLE_RAD = math.radians(0.1)
"""Root mean square over the angles of a triad."""
PART = 0.5
"""Of the angles themselves."""
TIMES_SD = 10.0


def refuse_other_misalignments(recording: ImuRecording, recorded: Recorded, known: Known) -> None:
    """Refuse recordings between which the misalignments change as those of no unit do.

    Raises
    ------
    RefusedError
    """
    starts = np.array(recording.starts_s)
    of = np.searchsorted(starts, recorded.start_s, side="right")
    mean_degc = [float(recorded.degc[of == k].mean()) for k in range(len(starts) + 1)]
    for title, index in (
        ("gyros", _angles(known.names, "Theta")),
        ("accelerometers", _angles(known.names, "Gamma")),
    ):
        value = np.array([_at(known, known.value, degc, index) for degc in mean_degc])
        sd = np.array([_at(known, known.sd, degc, index) for degc in mean_degc])
        for k in range(1, len(mean_degc)):
            change, unsure = _rms(value[k] - value[k - 1]), _rms(np.hypot(sd[k], sd[k - 1]))
            most = max(ANGLE_RAD, PART * _rms(value[k] + value[k - 1]) / 2, TIMES_SD * unsure)
            if change > most:
                raise RefusedError(
                    recording.names[k],
                    f"the {title}' misalignments differ by {math.degrees(change):.2g} deg from "
                    f"those of {recording.names[k - 1]}: rms from {mean_degc[k - 1]:.1f} to "
                    f"{mean_degc[k]:.1f} degC",
                    expected="recordings of one unit, whose axes keep their angles",
                    remedy="check that all are of one unit, with the same columns and signs",
                )


def _angles(names: tuple[str, ...], kind: str) -> list[int]:
    """Places of the elements of a matrix beside its diagonal."""
    return [k for k, n in enumerate(names) if n.startswith(kind) and n[-1] != n[-2]]


def _at(known: Known, values: FloatArray, degc: float, index: list[int]) -> FloatArray:
    return np.array([np.interp(degc, known.temps_degc, values[:, k]) for k in index])


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
