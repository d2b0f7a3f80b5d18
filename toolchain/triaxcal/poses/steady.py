"""Whether a still stretch is a pose: long enough, within range, held still, and not drifting."""

from __future__ import annotations

import numpy as np

from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray
from triaxcal.poses.stillness import duration_s
from triaxcal.readings.samples import READING, Samples
from triaxcal.unit.recording import RecordingLayout

_DRIFT_MAX = 6.0
"""Of its standard error: how far the two halves of a pose may differ."""
_MOVING = 0.1
"""Of 1 g: a pose whose readings scatter by more was not held still."""


class Steady:
    """Judges the still stretches of one recording by what all of its readings span."""

    def __init__(self, samples: Samples, layout: RecordingLayout) -> None:
        self._samples, self._layout = samples, layout
        self._low, self._high = samples.extremes(READING)
        # Counts do not say: half of what nine tenths of the samples span on the widest axis.
        rows = np.concatenate(samples.table.spool.stretches())
        spans = np.ptp(np.percentile(samples.cut(rows, READING), [5.0, 95.0], axis=0), axis=0)
        self._one_g = layout.reading_of_1_g or float(spans.max()) / 2.0

    def reason(self, run: tuple[int, int]) -> str:
        """Why a stretch at rest is no pose; "" if it is one."""
        samples, (start, stop) = self._samples, run
        length_s = duration_s(samples, run)
        if length_s < self._layout.still_s:
            return f"{length_s:.1f} s at rest, needs {self._layout.still_s:.1f}"
        deviation = samples.deviation(READING, start, stop)
        return (
            self._clipped(deviation, samples.part(READING, start, start + 1)[0])
            or self.moves(deviation)
            or self._drifts(deviation, run)
        )

    def moves(self, deviation: FloatArray) -> str:
        """Whether readings of that standard deviation, shape (3,), were not held still."""
        if deviation.max() <= _MOVING * self._one_g:
            return ""
        axis = int(deviation.argmax())
        return (
            f"axis {AXES[axis]} scatters by {deviation[axis]:.3g} "
            f"{self._layout.acceleration_unit}: it is not held still"
        )

    def _clipped(self, deviation: FloatArray, first: FloatArray) -> str:
        for axis in range(3):
            moves = self._low[axis] < self._high[axis]
            stuck = moves and deviation[axis] == 0.0 and (np.delete(deviation, axis) > 0.0).any()
            if stuck and first[axis] in (self._low[axis], self._high[axis]):
                return (
                    f"axis {AXES[axis]} is clipped: it stays at {first[axis]:g}, the largest or "
                    "smallest reading of the file; measure with a wider range"
                )
        return ""

    def _drifts(self, deviation: FloatArray, run: tuple[int, int]) -> str:
        samples, (start, stop) = self._samples, run
        half = start + (stop - start) // 2
        drift = np.abs(samples.mean(READING, half, stop) - samples.mean(READING, start, half))
        # Halves of independent noise differ by 2 standard errors of the mean.
        noise = 2.0 * deviation / np.sqrt(stop - start)
        worst = int(np.argmax(drift - _DRIFT_MAX * noise))
        if drift[worst] > _DRIFT_MAX * noise[worst] and drift[worst] > deviation[worst]:
            return (
                f"axis {AXES[worst]} drifts by {drift[worst]:.3g} "
                f"{self._layout.acceleration_unit} between its halves: it is still turning"
            )
        return ""
