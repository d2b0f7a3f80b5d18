"""Whether a still stretch is a pose: long enough, within range, and held still."""

from __future__ import annotations

import numpy as np

from triaxcal.model.positions import AXES
from triaxcal.model.types import BoolArray, FloatArray
from triaxcal.poses.stillness import duration_s
from triaxcal.readings.samples import READING, Samples
from triaxcal.unit.recording import RecordingLayout

_MOVING = 0.1
"""Of 1 g: a pose whose readings scatter by more was not held still."""
_SEEN = 5.0
"""Of the noise: readings that span less show one orientation alone."""


def reading_of_1_g(samples: Samples, layout: RecordingLayout) -> float:
    """About the reading of 1 g: as stated, unless the readings are far from it.

    Of counts it is half of what nine tenths of the samples span on the widest axis: their zero may
    lie anywhere.
    """
    rows = samples.cut(np.concatenate(samples.table.spool.stretches()), READING)
    length, stated = float(np.median(np.linalg.norm(rows, axis=1))), layout.reading_of_1_g
    if stated is not None and 0.5 * stated <= length <= 2.0 * stated:
        return stated
    span = float(np.ptp(np.percentile(rows, [5.0, 95.0], axis=0), axis=0).max()) / 2.0
    noise = float(np.median(np.abs(np.diff(rows, axis=0)))) if len(rows) > 1 else 0.0
    return (span if span > _SEEN * noise else length) or 1.0


class Steady:
    """Judges the stretches of one recording by what all of its readings span.

    Readings of an axis in `coarse` steps, (3,), stay at one value without being clipped.
    """

    def __init__(
        self, samples: Samples, layout: RecordingLayout, one_g: float, coarse: BoolArray
    ) -> None:
        self._samples, self._layout, self._one_g = samples, layout, one_g
        self._coarse = coarse
        self._low, self._high = samples.extremes(READING)

    def reason(self, run: tuple[int, int], scatter: FloatArray) -> tuple[str, str]:
        """Why a still stretch is no pose, and the end at which an output stays; "" if it is one."""
        length_s = duration_s(self._samples, run)
        # Stretches are found in whole cells: a rounding is no reason.
        if length_s < self._layout.still_s - 0.5 * self._samples.step_s:
            return f"{length_s:.1f} s at rest, needs {self._layout.still_s:.1f}", ""
        first = self._samples.part(READING, run[0], run[0] + 1)[0]
        axis = self._clipped(scatter, first)
        if axis is None:
            return self.moves(scatter), ""
        reason = (
            f"axis {AXES[axis]} is clipped: it stays at {first[axis]:g}, the largest or smallest "
            "reading of the file; measure with a wider range"
        )
        side = "above" if first[axis] == self._high[axis] else "below"
        return reason, f"{AXES[axis]} {side} {first[axis]:g}"

    def moves(self, scatter: FloatArray) -> str:
        """Whether readings of that standard deviation, shape (3,), were not held still."""
        if scatter.max() <= _MOVING * self._one_g:
            return ""
        axis = int(scatter.argmax())
        return (
            f"axis {AXES[axis]} scatters by {scatter[axis]:.3g} "
            f"{self._layout.acceleration_unit}: it is not held still"
        )

    def _clipped(self, scatter: FloatArray, first: FloatArray) -> int | None:
        for axis in range(3):
            moves = self._low[axis] < self._high[axis] and not self._coarse[axis]
            stuck = moves and scatter[axis] == 0.0 and (np.delete(scatter, axis) > 0.0).any()
            if stuck and first[axis] in (self._low[axis], self._high[axis]):
                return axis
        return None
