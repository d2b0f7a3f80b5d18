"""Counts that are coarser than the noise: their errors stay through a rest, and do not average.

Noise of the deviation s carries a reading over the edge of a count q. The mean of many readings is
then off by exp(-2 pi^2 (s/q)^2) q/pi at most: 0.04 q at s = q/3, and 0.14 q at q/5. The filter
takes the errors of samples for independent of each other.
"""

from __future__ import annotations

import numpy as np

from triaxcal.dynamic.recording import joined
from triaxcal.evidence.case import Case
from triaxcal.model.types import FloatArray

PART_S, PART_SAMPLES = 1.0, 100
"""Readings of so long, and so many, are looked at together."""
LONGEST_S = 60.0
FEW = 2
"""Different readings in a part: noise of a third of a count makes three."""
_CHUNK = 1 << 14


def coarse_counts(case: Case) -> tuple[str, ...]:
    """That a triad reads hardly more than one count at the longest rest, in words."""
    recording, survey = case.recording, case.result.survey
    rest = max(survey.rests, key=lambda rest: rest.duration_s)
    begin = int(survey.windows.first[rest.first])
    longest = round(min(LONGEST_S, rest.duration_s) * recording.rate_hz)
    samples = joined(recording.between(begin, begin + longest - 1, _CHUNK))
    length = max(PART_SAMPLES, round(PART_S * recording.rate_hz))
    triads = {"gyros": samples.rate, "accelerometers": samples.force}
    coarse = [name for name, values in triads.items() if _hardly_one(values, length)]
    if not coarse:
        return ()
    words = (
        f"at rest the {' and the '.join(coarse)} read one or two counts: counts coarser than the "
        "noise do not average, and the standard deviations are too small"
    )
    return (words,)


def _hardly_one(values: FloatArray, length: int) -> bool:
    """Whether most parts of the readings (n, 3) have at most `FEW` values on two axes or three."""
    parts = values[: len(values) // length * length].reshape(-1, length, 3)
    if not len(parts):
        return False
    # Readings of one count may differ in their last digits.
    steps = np.diff(np.sort(parts, axis=1), axis=1) > 1e-9 * np.abs(values).max()
    few = (steps.sum(axis=1) + 1 <= FEW).mean(axis=0)
    return bool(np.median(few) > 0.5)
