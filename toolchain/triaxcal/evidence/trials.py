"""Causes other than effects that are off: what is tried, and how.

A new one is a class with `name` and `of`, and its line in `TRIALS`.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from triaxcal.dynamic.recording import ImuSamples
from triaxcal.dynamic.survey import Survey
from triaxcal.dynamic.windows import WINDOW_S
from triaxcal.evidence.case import Case
from triaxcal.evidence.change import Change
from triaxcal.evidence.heldout import HeldOut
from triaxcal.evidence.stretches import at_rest, rests_of
from triaxcal.evidence.suspect import Suspect, Trial, again, innovations_again
from triaxcal.model.types import BoolArray, FloatArray

NOISIER = 1.1
"""Times the stated noise, at rest: noise figures are stated to about 5 %."""
MEDIAN = 0.4549
"""Of chi-square with one degree of freedom: where a rest begins or ends takes no part in it."""
UNEVEN = 1e-3
"""Of an interval: stamps that scatter by less are printed so."""
CLIPPED_SAMPLES = 3
"""A noisy gyro reads its largest value once, or by rounding twice; a clipped one more often."""


class Noise:
    """More noise than stated, by the scatter at rest, where no constant matters."""

    name = "noise"

    def of(self, case: Case, held: HeldOut | None, /) -> Suspect | None:
        """The noise as the rests scatter."""
        rate, force = noise_at_rest(case)
        if max(rate, force) <= NOISIER:
            return None
        rate, force = max(rate, 1.0), max(force, 1.0)
        more = case.noise.noisier(rate, force)
        words = (
            f"more noise than stated: at rest the gyros scatter by {rate:.3g} times what [noise] "
            f"states, the accelerometers by {force:.3g} times"
        )
        remedy = (
            f"state gyro_arw_deg_per_sqrt_h = {more.gyro_arw_deg_per_sqrt_h:.3g} and "
            f"accel_vrw_ug_per_sqrt_hz = {more.accel_vrw_ug_per_sqrt_hz:.4g}, or keep the unit "
            "from shaking"
        )
        more_noise = replace(case, noise=more)
        return replace(again(words, remedy, more_noise, held), direct=True)


def noise_at_rest(case: Case) -> tuple[float, float]:
    """Scatter of window means at rest over what [noise] states, of gyros and accelerometers.

    By differences of windows that follow each other: slow changes take no part in them.
    """
    found, recording, noise = case.result.survey, case.recording, case.noise
    windows, still = found.windows, at_rest(found)
    both = still[1:] & still[:-1] & (np.diff(windows.section) == 0)
    samples = max(1, round(WINDOW_S * recording.rate_hz))
    duration_s = samples / recording.rate_hz
    stated = (
        noise.rate_density**2 / duration_s,
        noise.mean_force_variance(duration_s, samples, recording.force_convention),
    )
    if both.sum() < 10:
        return 1.0, 1.0
    rate, force = (
        math.sqrt(float(np.median(np.diff(values, axis=0)[both] ** 2)) / MEDIAN / 2 / variance)
        for values, variance in zip((windows.rate, windows.force), stated, strict=True)
    )
    return rate, force


class Stamps:
    """Time stamps that scatter about an even sampling."""

    name = "time stamps"

    def of(self, case: Case, held: HeldOut | None, /) -> Suspect | None:
        """The same samples at even times in each section."""
        recording = case.recording
        samples = recording.all()
        step = np.diff(samples.time_s)
        interval = 1 / recording.rate_hz
        inside = step[step < 1.5 * interval]
        scatter = float(inside.std()) / interval if len(inside) else 0.0
        if scatter < UNEVEN:
            return None
        time_s = samples.time_s.copy()
        for section in case.result.survey.sections:
            first, last = section.first, section.last
            ends = float(time_s[first]), float(time_s[last])
            time_s[first : last + 1] = np.linspace(*ends, last + 1 - first)
        even = replace(samples, time_s=time_s)
        words = f"time stamps that scatter by {scatter:.2g} of an interval: even times fit"
        remedy = "state rate_hz in place of time_column, or record with the sensor's own clock"
        changed = replace(case, recording=replace(recording, pieces=lambda: (even,)))
        return again(words, remedy, changed, held)


class Clipping:
    """A gyro that reads exactly its largest value again and again."""

    name = "saturation"

    def of(self, case: Case, _held: HeldOut | None, /) -> Suspect | None:
        """Without the motions in which a gyro is clipped."""
        samples, survey = case.recording.all(), case.result.survey
        clipped, words = _clipped(samples, survey)
        if not words:
            return None
        left = innovations_again(case, *_without_motions(survey, samples.time_s[clipped]))
        remedy = "turn more slowly, or set a wider range"
        return Suspect(words, remedy, left, None, direct=True)


def _clipped(samples: ImuSamples, found: Survey) -> tuple[BoolArray, str]:
    """Samples at which a gyro is clipped, and words for it."""
    marked, words = np.zeros(len(samples), dtype=bool), []
    at_rest = np.array([s.rate for s in found.sections]).mean(axis=0)
    for axis in range(3):
        rate = samples.rate[:, axis]
        fastest = np.abs(rate - at_rest[axis]).max()
        ends = [e for e in (rate.max(), rate.min()) if abs(e - at_rest[axis]) > fastest / 2]
        own = np.isin(rate, [e for e in ends if (rate == e).sum() >= CLIPPED_SAMPLES])
        if own.any():
            marked |= own
            words.append(f"gyro {'xyz'[axis]} reads exactly its largest value {own.sum()} times")
    return marked, f"saturation: {', '.join(words)}" if words else ""


def _without_motions(found: Survey, times_s: FloatArray) -> tuple[Survey, tuple[float, ...]]:
    """Nothing measured, and the attitude forgotten, in the motions that hold the times."""
    start = found.windows.start_s
    use, cuts = found.use.copy(), []
    for rests in rests_of(found):
        for before, after in pairwise(rests):
            if ((times_s > before.end_s) & (times_s < after.start_s)).any():
                use &= ~((start > before.end_s - WINDOW_S) & (start < after.start_s))
                cuts.append(after.start_s)
    return replace(found, use=use), tuple(cuts)


TRIALS: tuple[Trial, ...] = (Noise(), Stamps(), Clipping(), Change())
