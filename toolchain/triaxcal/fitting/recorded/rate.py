"""dT/dt at the poses of a recording, and the half-cycles on which a term in it is judged.

A pose's rate is the slope of a straight line through the temperatures within `WINDOW_S` about its
middle, less at the ends of the recording, where a window to one side would have another rate, and
reaching to the neighbouring poses where nothing was recorded between.
"""

from __future__ import annotations

import numpy as np

from triaxcal.fitting.core.halfcycles import half_cycles
from triaxcal.model.types import BoolArray, FloatArray
from triaxcal.poses.poseset import PoseSet
from triaxcal.readings.samples import TEMP, Samples
from triaxcal.readings.spool import SAMPLED
from triaxcal.readings.table import TIME
from triaxcal.unit.recording import SAMPLES, RecordingLayout

WINDOW_S = 60.0
_HALF_MIN_S = 5.0
HALVES_MIN = 3
"""Half-cycles: with one of two held out, the other's rate is a constant like the bias."""
_ROUNDING_DECIMALS = 6
"""Of a temperature in degC: no thermometer has a finer step, and units are turned with less."""


def pose_rates(samples: Samples, poses: PoseSet, layout: RecordingLayout) -> FloatArray | None:
    """dT/dt, K/s, shape (poses,).

    None without temperatures or a clock, and where at no pose the temperature goes as far as one
    step of the thermometer: on plateaus there is no rate to be seen.
    """
    if TEMP not in samples or layout.rows != SAMPLES or len(poses.poses) < 2:
        return None
    end_s = samples.one(TIME, len(samples) - 1)
    starts = np.array([p.start_s for p in poses.poses])
    stops = starts + np.array([p.duration_s for p in poses.poses])
    step = _thermometer_step(samples)
    rates, moved = [], 0.0
    for k, middle in enumerate((starts + stops) / 2.0):
        half = max(min(WINDOW_S / 2.0, middle, end_s - middle), _HALF_MIN_S)
        first, last = samples.first_from(middle - half), samples.first_from(middle + half)
        if samples.one(TIME, last - 1) - samples.one(TIME, first) < half:
            begin, end = starts[max(k - 1, 0)], stops[min(k + 1, len(stops) - 1)]
            first, last = samples.first_from(begin), samples.first_from(end)
        t = samples.part(TIME, first, last)
        x = t - t.mean()
        rates.append(float(x @ samples.part(TEMP, first, last)) / (float(x @ x) or 1.0))
        moved = max(moved, abs(rates[-1]) * float(x[-1] - x[0]))
    return np.array(rates) if moved >= step else None


def _thermometer_step(samples: Samples) -> float:
    """Least difference of two temperatures, degC; infinite where they are all the same."""
    levels = np.empty(0)
    for _, rows in samples.pieces():
        levels = np.union1d(levels, samples.cut(rows, TEMP).round(_ROUNDING_DECIMALS))
        if len(levels) > SAMPLED:  # no steps but noise
            break
    return float(np.diff(levels).min()) if len(levels) > 1 else np.inf


def half_cycle_turns(temps_degc: FloatArray) -> list[tuple[BoolArray, BoolArray]]:
    """Masks of each half-cycle of the poses, in time, and of those of it that can be judged.

    Judged are poses at temperatures that the other half-cycles have; none of fewer than three.
    """
    halves = half_cycles(temps_degc)
    if len(halves) < HALVES_MIN:
        return []
    turns = []
    for half in halves:
        out = np.zeros(len(temps_degc), dtype=np.bool_)
        out[half.start : half.stop] = True
        low, high = temps_degc[~out].min(), temps_degc[~out].max()
        judged = out & (low <= temps_degc) & (temps_degc <= high)
        if judged.any():
            turns.append((out, judged))
    return turns
