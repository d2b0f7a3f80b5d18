"""Axes, signs or units that change within a recording: two logs in one file, or another driver.

From window to window gravity turns in the unit as f1 - f0 = [f] M w dt. M is tried as the identity,
as every signed permutation, and as these with the factor of another unit or another kind of
samples, before and after each moment. A recording in which one M before and another one after a
moment leave well less than what the best single one leaves has changed there: accelerations of
the hand, which are the rest of it, do not prefer another M.
"""

from __future__ import annotations

import math
from itertools import permutations, product

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.blocks.attitude import skew
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.dynamic.windows import Windows
from triaxcal.model.types import FloatArray

LEFT = 0.85
"""Of the squares that the best single M leaves."""
PART = 0.1
"""Of all squares: on each side of the moment so much has to turn."""
LEAST_RAD = 2.0
"""Of gravity's way in the unit on each side: some axes fit a shorter one by chance."""


def refuse_change(recording: ImuRecording, windows: Windows, bias: FloatArray) -> None:
    """Refuse a recording whose axes, signs or units of rate change at a moment.

    Raises
    ------
    RefusedError
    """
    follows = (np.diff(windows.first) > 0) & (np.diff(windows.section) == 0)
    force = windows.force / np.linalg.norm(windows.force, axis=1)[:, None]
    rate = windows.rate - bias
    turn = ((rate[:-1] + rate[1:]) / 2 * np.diff(windows.start_s)[:, None])[follows]
    middle = skew((force[1:] + force[:-1]) / 2)[follows]
    change = (force[1:] - force[:-1])[follows]
    at_s = windows.start_s[1:][follows]
    every = np.cumsum((change**2).sum(axis=1))
    if len(every) < 2:
        return
    entries = [(M, factor) for factor in _factors(recording.rate_hz) for M in _axes()]
    left = np.array(
        [
            np.cumsum(((change - factor * np.einsum("nij,nj->ni", middle, turn @ M.T)) ** 2).sum(1))
            for M, factor in entries
        ]
    )
    way = np.cumsum(np.linalg.norm(change, axis=1))
    inside = (every > PART * every[-1]) & (every < (1 - PART) * every[-1])
    inside &= (way > LEAST_RAD) & (way < way[-1] - LEAST_RAD)
    if not inside.any():
        return
    after = left[:, -1:] - left
    both = left.min(axis=0) + after.min(axis=0)
    both[~inside] = np.inf
    k = int(np.argmin(both))
    early, late = (int(np.argmin(side[:, k])) for side in (left, after))
    if early == late or both[k] > LEFT * left[:, -1].min():
        return
    raise RefusedError(
        f"{recording.name}, {at_s[k]:.1f} s",
        f"up to here the forces turn about x, y, z as {_words(*entries[early])}, "
        f"and from here on as {_words(*entries[late])}",
        expected="the same axes, units and kind of samples throughout",
        remedy="cut the recording there and calibrate each part with its own columns and units",
    )


def _axes() -> list[FloatArray]:
    """Every signed permutation, the identity first."""
    return [
        np.diag(signs)[:, list(order)]
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
    ]


def _factors(rate_hz: float) -> tuple[float, ...]:
    return (1.0, rate_hz, 1 / rate_hz, 180 / math.pi, math.pi / 180)


def _words(M: FloatArray, factor: float) -> str:
    names = [
        ("-" if row.sum() < 0 else "") + "xyz"[int(np.flatnonzero(row)[0])] for row in M
    ]  # fmt: skip
    size = "" if factor == 1.0 else f"about {factor:.3g} times "
    return f"{size}the gyros' {', '.join(names)}"
