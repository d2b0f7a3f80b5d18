"""The part of a recording that a spectrum can be made of: an even clock, no gap."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.readings.samples import Samples
from triaxcal.readings.table import GAP, TIME

_GAP = 1.5
"""Of the median step: a step as long as that has lost a sample. (`GAP` is for poses.)"""
_UNEVEN = 0.2
"""Standard deviation of the other steps, of their median."""
SAMPLES_MIN = 256
assert _GAP < GAP


@dataclass(frozen=True)
class Stretch:
    """Samples `start` to `stop`, stop excluded, one every `step_s`.

    Attributes
    ----------
    findings : tuple of str
        What was left out.
    """

    start: int
    stop: int
    step_s: float
    findings: tuple[str, ...]

    @property
    def duration_s(self) -> float:
        """Samples times step."""
        return (self.stop - self.start) * self.step_s


def even_stretch(samples: Samples) -> Stretch:
    """Longest stretch of a recording without a gap.

    Raises
    ------
    RefusedError
        When the steps of time differ, or no stretch has `SAMPLES_MIN` samples.
    """
    t = samples.part(TIME)
    steps = np.diff(t)
    median = float(np.median(steps)) if len(steps) else 1.0
    gap = steps > _GAP * median
    if len(steps) and float(np.std(steps[~gap])) > _UNEVEN * median:
        raise RefusedError(
            samples.source,
            f"steps of time from {steps.min():.4g} to {steps.max():.4g} s",
            expected="samples at even times",
            remedy="record with an even clock; if it was even and the stamps are not, leave the "
            "time out and give sample_rate_hz",
        )
    ends = np.concatenate([[0], np.flatnonzero(gap) + 1, [len(t)]])
    longest = int(np.argmax(np.diff(ends)))
    start, stop = int(ends[longest]), int(ends[longest + 1])
    if stop - start < SAMPLES_MIN:
        raise RefusedError(
            samples.source,
            f"{stop - start} samples without a gap",
            expected=f"{SAMPLES_MIN} at least",
            remedy="record longer",
        )
    findings: tuple[str, ...] = ()
    if gap.any():
        count = int(gap.sum())
        words = f"{count} gap{'s' * (count != 1)} in time, the first before "
        words += f"{samples.place(int(ends[1]))}: the longest stretch without one is used, "
        findings = (words + f"{100.0 * (stop - start) / len(t):.0f} % of the samples",)
    step = float((t[stop - 1] - t[start]) / (stop - start - 1))
    return Stretch(start, stop, step, findings)
