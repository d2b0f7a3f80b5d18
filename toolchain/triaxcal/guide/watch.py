"""Rests and motions in samples as they come.

Means over a tenth of a second are still where the gyros read their bias and the force is that of
the rest so far. The bias is what the gyros read at the last rest. This is for the screen alone; a
calibration finds the rests anew, from the whole recording.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.dynamic.blocks.attitude import matrix_of, quaternion_of, running_product
from triaxcal.dynamic.recording import ImuSamples
from triaxcal.model.types import FloatArray

WINDOW_S = 0.1
STILL_RAD_PER_S = np.radians(1.5)
STILL_M_PER_S2 = 0.15
"""What a hand may do to a unit that it holds still."""
FIRST_S = 2.0
"""At rest, until the bias of the gyros is known."""
BEGIN = 5
"""Still windows that make a rest."""


@dataclass(frozen=True)
class Motion:
    """From one rest to the next.

    Attributes
    ----------
    before, after : arrays, shape (3,)
        Up, instrument axes.
    before_s : float
        Length of the rest before.
    rate, ups : arrays, shape (n, 3)
        rad/s; up, at n moments.
    to_end : array, shape (n, 3, 3)
        From the axes of each moment to those of the end.
    step_s : float
        Between the moments.
    """

    before: FloatArray
    after: FloatArray
    before_s: float
    rate: FloatArray
    ups: FloatArray
    to_end: FloatArray
    step_s: float


class Watch:
    """Looks at samples of a recording; `feed` gives each motion once the next rest is there.

    Attributes
    ----------
    resting_s : float
        Length of the present rest; 0 while the unit moves.
    """

    def __init__(self, rate_hz: float) -> None:
        self._size = max(1, round(WINDOW_S * rate_hz))
        self._step_s = self._size / rate_hz
        self._rows = np.zeros((0, 6))
        self._bias: FloatArray | None = None
        self._rest: list[FloatArray] = []
        self._moving: list[FloatArray] = []
        self._before: tuple[FloatArray, float] | None = None
        self._trial: list[FloatArray] = []

    @property
    def resting_s(self) -> float:
        """Length of the present rest; 0 while the unit moves."""
        return len(self._rest) * self._step_s

    @property
    def up(self) -> FloatArray | None:
        """Up at the present rest, else at the last one, instrument axes; None before the first."""
        if self._rest:
            return _up(self._rest)
        return None if self._before is None else self._before[0]

    def feed(self, samples: ImuSamples) -> list[Motion]:
        """Motions that these samples end."""
        rows = np.concatenate([self._rows, np.hstack([samples.rate, samples.force])])
        count = len(rows) // self._size
        self._rows = rows[count * self._size :]
        means = rows[: count * self._size].reshape(count, self._size, 6).mean(axis=1)
        return [motion for mean in means if (motion := self._window(mean)) is not None]

    def _window(self, mean: FloatArray) -> Motion | None:
        if self._bias is None:
            self._first(mean)
            return None
        if self._rest:
            if self._is_still(mean, self._rest):
                self._rest.append(mean)
                return None
            self._leave()
        self._trial = [*self._trial, mean] if self._is_still(mean, self._trial) else []
        self._moving.append(mean)
        if len(self._trial) < BEGIN:
            return None
        self._rest, self._trial = self._trial, []
        moving, self._moving = self._moving[: -len(self._rest)], []
        return self._motion(moving)

    def _first(self, mean: FloatArray) -> None:
        """Wait for the first rest: nothing turns, and gravity stays where it is."""
        self._rest.append(mean)
        last = np.array(self._rest)
        spread = np.ptp(last, axis=0)
        if (spread[:3] > 2 * STILL_RAD_PER_S).any() or (spread[3:] > 2 * STILL_M_PER_S2).any():
            self._rest = [mean]
        elif self.resting_s >= FIRST_S:
            self._bias = last[:, :3].mean(axis=0)

    def _is_still(self, mean: FloatArray, rest: list[FloatArray]) -> bool:
        assert self._bias is not None
        if np.abs(mean[:3] - self._bias).max() > STILL_RAD_PER_S:
            return False
        if not rest:
            return True
        return bool(np.abs(mean[3:] - np.mean(rest, axis=0)[3:]).max() < STILL_M_PER_S2)

    def _leave(self) -> None:
        """The present rest is over."""
        self._before = _up(self._rest), self.resting_s
        if self.resting_s >= FIRST_S:
            self._bias = np.mean(self._rest, axis=0)[:3]
        self._rest = []

    def _motion(self, moving: list[FloatArray]) -> Motion:
        assert self._bias is not None
        assert self._before is not None
        before, seconds = self._before
        rate = (np.array(moving) if moving else np.zeros((1, 6)))[:, :3] - self._bias
        half = rate * (self._step_s / 2)
        steps = quaternion_of(np.repeat(half, 2, axis=0))
        attitude = matrix_of(running_product(steps))  # instrument axes to those of the start
        middle = attitude[::2]
        ups, to_end = middle.swapaxes(1, 2) @ before, attitude[-1].T @ middle
        return Motion(before, _up(self._rest), seconds, rate, ups, to_end, self._step_s)


def _up(rest: list[FloatArray]) -> FloatArray:
    force = np.mean(rest, axis=0)[3:]
    up: FloatArray = force / np.linalg.norm(force)
    return up
