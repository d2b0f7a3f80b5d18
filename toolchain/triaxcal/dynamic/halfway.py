"""Axes, signs or units that change within a recording: two logs in one file, or another driver.

From window to window gravity turns in the unit as f1 - f0 = [f] M w dt. M is tried as the identity,
as every signed permutation, and as these with the factor of another unit or another kind of
samples, before and after each moment. A recording in which one M before and another one after a
moment leave well less than what the best single one leaves has changed there: accelerations of
the hand, which are the rest of it, do not prefer another M.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.gravityturns import GravityTurns, signed_axes_matrices
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.dynamic.windows import Windows
from triaxcal.model.types import FloatArray

LEFT = 0.6
"""Of the squares that the best single M leaves."""
DESCRIBED = 0.1
"""Of all squares: where one M leaves less, it describes the recording. On a table each stage turns
about one axis, and several M are as good there."""
UNEXPLAINED = 0.7
"""Of all squares: where no rates explain how the forces turn, none are better than others."""
FEWEST = 20
"""Windows: with fewer, one of so many M fits by chance."""
PART = 0.2
"""Of all squares: on each side of the moment so much has to turn."""
LEAST_RAD = 2.0
"""Of gravity's way in the unit on each side: some axes fit a shorter one by chance."""


@dataclass(frozen=True)
class Left:
    """Squares that each M leaves, summed from the first window on.

    Attributes
    ----------
    entries : tuple of (array of shape (3, 3), float)
        M and its factor, the identity first.
    at_s : array, shape (n,)
    sums : array, shape (entries, n)
    every : array, shape (n,)
        Where nothing turns.
    """

    entries: tuple[tuple[FloatArray, float], ...]
    at_s: FloatArray
    sums: FloatArray
    every: FloatArray

    @property
    def other_axes(self) -> float:
        """What the best M leaves, as a part of what the identity leaves."""
        whole = self.sums[:, -1]
        return float(whole.min() / whole[0]) if whole[0] > 0 else 1.0


def _effective(squares: FloatArray) -> float:
    """How many windows have most of the squares."""
    return float(squares.sum() ** 2 / max(float((squares**2).sum()), 1e-300))


def left_by_axes(recording: ImuRecording, windows: Windows, turns: GravityTurns) -> Left | None:
    """Squares that each M leaves of the forces' turning; None where few windows have most."""
    alone = turns.alone
    if alone.sum() < 2:
        return None
    middle, turn, change = turns.middle[alone], turns.turn[alone], turns.change[alone]
    squares = (change**2).sum(axis=1)
    if _effective(squares) < FEWEST:
        return None
    axes = signed_axes_matrices()
    entries = tuple((M, factor) for factor in _factors(recording.rate_hz) for M in axes)
    sums = [
        np.cumsum(((change - factor * np.einsum("nij,nj->ni", middle, turn @ M.T)) ** 2).sum(1))
        for M, factor in entries
    ]
    return Left(entries, windows.start_s[1:][alone], np.array(sums), np.cumsum(squares))


def refuse_change(recording: ImuRecording, left: Left) -> None:
    """Refuse a recording whose axes, signs or units of rate change at a moment.

    Raises
    ------
    RefusedError
    """
    inside = (left.every > PART * left.every[-1]) & (left.every < (1 - PART) * left.every[-1])
    if not inside.any():
        return
    after = left.sums[:, -1:] - left.sums
    both = left.sums.min(axis=0) + after.min(axis=0)
    both[~inside] = np.inf
    k = int(np.argmin(both))
    early, late = (int(np.argmin(side[:, k])) for side in (left.sums, after))
    best = float(left.sums[:, -1].min())
    if early == late or best < DESCRIBED * left.every[-1]:
        return
    if both[k] > min(LEFT * best, UNEXPLAINED * left.every[-1]):
        return
    squares = np.diff(left.every, prepend=0.0)
    if min(_effective(squares[: k + 1]), _effective(squares[k + 1 :])) < FEWEST:
        return
    raise RefusedError(
        f"{recording.name}, {left.at_s[k]:.1f} s",
        f"up to here the forces turn about x, y, z as {_words(*left.entries[early])}, "
        f"and from here on as {_words(*left.entries[late])}",
        expected="the same axes, units and kind of samples throughout",
        remedy="cut the recording there and calibrate each part with its own columns and units",
    )


def _factors(rate_hz: float) -> tuple[float, ...]:
    return (1.0, rate_hz, 1 / rate_hz, 180 / math.pi, math.pi / 180)


def _words(M: FloatArray, factor: float) -> str:
    names = [
        ("-" if row.sum() < 0 else "") + "xyz"[int(np.flatnonzero(row)[0])] for row in M
    ]  # fmt: skip
    size = "" if factor == 1.0 else f"about {factor:.3g} times "
    return f"{size}the gyros' {', '.join(names)}"
