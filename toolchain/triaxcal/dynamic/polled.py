"""White noise of a sensor that is asked less often than it samples.

A data sheet's density is that of samples which follow each other. A log that keeps one sample of
four has the same scatter at a quarter of the rate: twice the density. So of a triad that a log has
at a lower rate than its rows, the scatter from sample to sample counts where it is larger.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from triaxcal.dynamic.noise import MICRO_G, DataSheet
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.dynamic.series import Series
from triaxcal.model.types import FloatArray
from triaxcal.readings.held import moving

LARGER = 1.2
"""Of the stated deviation: what is seen is known to some per cent, and no rest is wholly still."""
_ROOT_SUM = math.sqrt(6.0)
"""Of the weights 1, -2, 1."""


def white_density(series: Series, place: slice) -> float:
    """Random walk N of a triad, unit of its readings times sqrt(s), where it does not move.

    By second differences, in which no slow motion is left; the root of the mean square of the axes.
    """
    values = series.values[:, place]
    bent: FloatArray = values[2:] - 2 * values[1:-1] + values[:-2]
    beats = series.beat[2:] - series.beat[:-2] == 2
    bent = bent[beats & ~moving(values)[1:-1]]
    if len(bent) == 0:
        return 0.0
    # The middle two thirds, free of knocks; of readings that hardly leave a count all of them.
    low, high = np.quantile(bent, [0.16, 0.84], axis=0)
    sd = np.maximum((high - low) / 2, 0.0)
    sd = np.where(sd > 0, sd, bent.std(axis=0))
    return float(np.sqrt(np.mean(sd**2)) / _ROOT_SUM * np.sqrt(series.step_s))


def at_least_seen(recording: ImuRecording, noise: DataSheet) -> DataSheet:
    """Noise as it is stated, or as large as a slower triad shows it; none where none is stated."""
    rate, force = recording.seen_density.get("rate", 0.0), recording.seen_density.get("force", 0.0)
    if noise.gyro_arw_deg_per_sqrt_h is not None and rate > LARGER * noise.rate_density:
        noise = replace(noise, gyro_arw_deg_per_sqrt_h=math.degrees(rate) * 60)
    if noise.accel_vrw_ug_per_sqrt_hz is None:
        return noise
    counts = (noise.accel_lsb * MICRO_G) ** 2 / 12 / (recording.force_hz or recording.rate_hz)
    if force > LARGER * math.sqrt(noise.force_density() ** 2 + counts):
        noise = replace(noise, accel_vrw_ug_per_sqrt_hz=force / MICRO_G, accel_lsb=0.0)
    return noise


def density_words(name: str, density: float) -> str:
    """For the report."""
    value = (
        f"{math.degrees(density) * 60:.3g} deg/sqrt(h)"
        if name == "rate"
        else f"{density / MICRO_G:.3g} micro-g/sqrt(Hz)"
    )
    return f"white noise of {value} from sample to sample, used where [noise] states less"
