"""Forces that are later or earlier than the rates: two clocks, or times of two origins.

From window to window gravity turns in the unit as f1 - f0 = [f] w dt, with f and w of one time. If
the forces of other windows fit far better, the times of the two triads differ. Small delays are no
matter for rests, and the block "delay" is for them on a table.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.gravityturns import GravityTurns
from triaxcal.dynamic.halfway import DESCRIBED, UNEXPLAINED
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.dynamic.windows import WINDOW_S, Windows
from triaxcal.model.types import FloatArray

LONGEST_S, SHORTEST_S = 10.0, 0.25
LEFT = 0.6
"""Of the squares that windows of one time leave."""
PARTS = 3
"""Of the recording, with a lag each."""


def refuse_lag(
    recording: ImuRecording, windows: Windows, turns: GravityTurns, other_axes: float
) -> None:
    """Refuse forces that belong to other times than the rates.

    `other_axes` is what exchanged axes at equal times would leave of the squares.

    Raises
    ------
    RefusedError
    """
    count = len(windows.first)
    reach = min(round(LONGEST_S / WINDOW_S), count // (4 * PARTS))
    if reach < 1:
        return
    lags = np.arange(-reach, reach + 1)
    still = replace(turns, turn=np.zeros_like(turns.turn))  # leaves all squares
    left = np.array([_left(windows, turns, int(lag)) for lag in lags])
    whole = left.sum(axis=1)
    best = lags[int(np.argmin(whole))] * WINDOW_S
    each = lags[np.argmin(left, axis=0)] * WINDOW_S
    explained = float(left.min(axis=0).sum())
    every = float(_left(windows, still, 0).sum())
    if whole[reach] < DESCRIBED * every or np.abs(each).max() < SHORTEST_S:
        return
    # Of the squares at these lags: a jump of the forces, which no rate explains, is beyond some.
    later = [
        float(_left(windows, still, int(lags[k]))[i]) for i, k in enumerate(left.argmin(axis=0))
    ]
    if explained > min(LEFT * other_axes * whole[reach], UNEXPLAINED * min(every, sum(later))):
        return
    found = f"the forces are {abs(best):.1f} s {'late' if best > 0 else 'early'} against the rates"
    expected, remedy = "times of one clock for both triads", "correct the times of one of them"
    if np.ptp(each) > SHORTEST_S:
        first, last = each[0], each[-1]
        found = (
            f"the forces are late against the rates by {first:.1f} s at first and by {last:.1f} s "
            "at the end: two clocks of different rates"
        )
        remedy = "bring the times of both to one clock before"
    raise RefusedError(recording.name, found, expected=expected, remedy=remedy)


def _left(windows: Windows, turns: GravityTurns, lag: int) -> FloatArray:
    """Squares (PARTS,) that are left where forces are `lag` windows later than rates."""
    count = len(windows.first)
    edge = round(LONGEST_S / WINDOW_S)
    at = np.arange(edge, count - 1 - edge) if count > 4 * edge else np.arange(abs(lag), count - 1)
    at = at[(at + lag >= 0) & (at + lag + 1 < count)]
    later = at + lag
    whole = turns.follows[at] & turns.alone[later]
    miss = turns.change[later] - np.einsum("nij,nj->ni", turns.middle[later], turns.turn[at])
    square = np.where(whole, (miss**2).sum(axis=1), 0.0)
    return np.array([part.sum() for part in np.array_split(square, PARTS)])
