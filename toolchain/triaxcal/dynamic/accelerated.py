"""Rests in a moving vehicle: how much a force at rest may differ, and the refusals."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.recording import ImuRecording

OUTLIER_M_PER_S2 = 0.05
"""A steady acceleration of less is that of a hand: 0.3 deg of tilt."""
OUTLIER_M_PER_S2_PER_K = 5e-3
"""Half a mg a degree, for coarse accelerometers whose temperature changed in the recording."""
SHAKEN_TIMES, SHAKEN_M_PER_S2 = 10.0, 0.1
"""Samples of a rest that scatter so many times as stated, and by so much, are shaken."""

EXPECTED = "rests on something that does not move"


def rest_tolerance(recording: ImuRecording) -> float:
    """By how much |a| of rests may differ from gravity, m/s^2: a hand, and a temperature."""
    low, high = math.inf, -math.inf
    for piece in recording.pieces():
        if piece.temp_degc is None:
            break
        low = min(low, float(piece.temp_degc.min(initial=math.inf)))
        high = max(high, float(piece.temp_degc.max(initial=-math.inf)))
    return OUTLIER_M_PER_S2 + OUTLIER_M_PER_S2_PER_K * max(high - low, 0.0)


def never_at_rest(name: str, rests: int, rms_m_per_s2: float) -> RefusedError:
    """For rests that no constants make as large as gravity: all of them are accelerated."""
    return RefusedError(
        name,
        f"the forces of {rests} rests differ from gravity by {rms_m_per_s2:.2g} m/s^2 rms, "
        "whatever the biases and scale factors: the unit was accelerated, or its accelerometers "
        "are far from linear",
        expected=EXPECTED,
        remedy="record where nothing drives, swings or is leaned on",
    )


def refuse_shaken(name: str, scatters: Sequence[float], stated: float) -> None:
    """Refuse rests whose samples scatter by `scatters`, far beyond `stated`, m/s^2."""
    scatter = float(np.median(scatters))
    if scatter > max(SHAKEN_M_PER_S2, SHAKEN_TIMES * stated):
        raise RefusedError(
            name,
            f"the forces of the rests scatter by {scatter:.2g} m/s^2, {scatter / stated:.0f} times "
            "the noise of [noise]: the unit is shaken",
            expected=EXPECTED,
            remedy="record where no engine runs, or correct [noise]",
        )
