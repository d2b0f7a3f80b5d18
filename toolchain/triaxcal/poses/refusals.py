"""What to say of a recording without a pose."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.poses.poseset import Stillness
from triaxcal.readings.samples import Samples
from triaxcal.readings.table import TIME
from triaxcal.unit.recording import RecordingLayout
from triaxcal.unit.recordingfile import TIME_UNITS

_STEPS_S = (5e-4, 0.5)
"""Plausible times between samples: they distinguish seconds from milliseconds."""


def no_poses(
    samples: Samples,
    layout: RecordingLayout,
    stillness: Stillness,
    refused: Sequence[tuple[float, str]],
    one_g: float,
) -> RefusedError:
    """What is found where there is no pose; `refused` has length and fault of still stretches."""
    if refused:
        longest = max(length for length, _ in refused)
        found = f"the longest stretch at rest lasts {longest:.3g} s; pose 1: {refused[0][1]}"
    else:
        moved = stillness.quietest / one_g
        found = (
            "it moves all the time; even at its quietest the mean reading changes by "
            f"{moved * 1e3:.2g} mg within 0.4 s, like a turn of {np.degrees(moved):.1g} deg"
        )
    return RefusedError(
        samples.source,
        f"no pose found: {found}",
        expected=f"poses of at least {layout.still_s:g} s, held much more still than the turns "
        "between them",
        remedy=_wrong_clock(samples, layout)
        or "hold each pose longer, or lower [recording] still_s",
    )


def _wrong_clock(samples: Samples, layout: RecordingLayout) -> str:
    """Remedy for a recording that is too short for a few poses; "" otherwise."""
    whole = samples.one(TIME, len(samples) - 1) + samples.step_s
    if whole > 4.0 * layout.still_s:
        return ""
    lasts = f"the whole recording lasts {whole:.3g} s"
    if layout.sample_rate_hz is not None:
        return f"{lasts} at {1.0 / samples.step_s:g} Hz: check sample_rate_hz"
    if not layout.time:
        return lasts
    scale = TIME_UNITS[layout.time_unit[0]]
    near = [
        u for u, s in TIME_UNITS.items() if _STEPS_S[0] < samples.step_s / scale * s < _STEPS_S[1]
    ]
    return f"{lasts}: check time_unit" + (f', as time_unit = "{near[0]}"' if near else "")
