"""Numbers of samples: 0, 1, 2, ... since the first; a number that is left out is a lost sample.

By the counter, whose turns are taken from the time of arrival; the unit's own clock, where it has
one, must then agree. Without a counter by the unit's clock; without either by the time of arrival
alone, which shows gaps only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.model.types import FloatArray, IntArray
from triaxcal.rig.bus.frames import BoolArray

CLOCK_ERROR = 200e-6
"""How far the unit's clock and ours may differ, twice what a poor quartz does."""
LATE_PERIODS, LATE_S = 2.5, 0.05
"""Without counter and clock: a pause longer than both is a loss; drivers delay frames by less."""
_CROWDED = 0.75
"""Without counter and clock: a second's samples in less of a second come from two nodes."""
_TURN_SHARE = 0.25
"""Of a counter's turn: how far arrival and counter may differ where there is no clock."""


@dataclass(frozen=True)
class Clocks:
    """What numbers can be made by.

    Attributes
    ----------
    counter_modulus : int
        Number of the counter's values; 0 without a counter.
    time_turn : int
        Steps of the unit's clock after which it is 0 again; 0 without a clock.
    tick_us : float
        Length of one step.
    """

    rate_hz: int
    counter_modulus: int = 0
    time_turn: int = 0
    tick_us: float = 1.0


@dataclass(frozen=True)
class _Last:
    """What is remembered of the sample before."""

    number: int
    t_ns: int
    sequence: int
    time: int


@dataclass(frozen=True)
class Numbered:
    """Numbers of samples.

    Attributes
    ----------
    number : int64 array, shape (n,)
    duplicate, conflict : bool arrays, shape (n,)
        Sent twice; of the counter or clock of the one before, and with other codes.
    jump : bool array, shape (n,)
        Does not fit the one before.
    """

    number: IntArray
    duplicate: BoolArray
    conflict: BoolArray
    jump: BoolArray


class Numbering:
    """Numbers samples, remembering the one before the batch."""

    def __init__(self, clocks: Clocks) -> None:
        self._clocks = clocks
        self._last: _Last | None = None
        self._recent: IntArray = np.zeros(0, np.int64)
        self._codes: np.ndarray | None = None

    @property
    def last(self) -> int:
        """Number of the last sample; -1 before the first."""
        return -1 if self._last is None else self._last.number

    def number(
        self, t_ns: IntArray, sequence: IntArray, time: IntArray, codes: np.ndarray
    ) -> Numbered:
        """Numbers of samples.

        Parameters
        ----------
        t_ns, sequence, time : arrays, shape (n,)
            Arrival, counter and the unit's clock; any numbers where there is none.
        codes : array, shape (n, 3)
            What they hold: a sample that is sent twice has the same codes both times.
        """
        if not len(t_ns):
            nothing = np.zeros(0, np.bool_)
            return Numbered(np.zeros(0, np.int64), nothing, nothing, nothing)
        clocks = self._clocks
        last = self._last or _Last(-1, int(t_ns[0]), int(sequence[0]), int(time[0]))
        d_host_s: FloatArray = np.multiply(_steps(t_ns, last.t_ns), 1e-9)
        d_host = np.rint(d_host_s * clocks.rate_hz).astype(np.int64)
        d_time = _steps(time, last.time) % max(clocks.time_turn, 1)
        if clocks.counter_modulus:
            d_sequence = _steps(sequence, last.sequence)
            step, duplicate = self._by_counter(d_sequence, d_host)
            duplicate &= d_time == 0
        elif clocks.time_turn:
            step, duplicate = self._by_clock(d_time, d_host_s, d_host)
        else:
            late = d_host_s > max(LATE_PERIODS / clocks.rate_hz, LATE_S)
            step, duplicate = np.where(late, d_host, 1), np.zeros(len(t_ns), np.bool_)
        same = self._same(codes)
        conflict = duplicate & ~same
        duplicate &= same
        jump = step <= 0
        if clocks.time_turn:
            jump |= self._off_clock(d_time, step)
        elif clocks.counter_modulus:
            tolerance = max(clocks.counter_modulus * _TURN_SHARE, LATE_S * clocks.rate_hz)
            jump |= np.abs(d_host - step) > tolerance
        else:
            jump |= self._crowded(t_ns)
        step = np.where(jump, np.maximum(d_host, 1), step)
        if self._last is None:
            duplicate[0], conflict[0], jump[0], step[0] = False, False, False, 1
        step[duplicate] = 0
        jump &= ~duplicate
        number: IntArray = last.number + np.cumsum(step)
        self._last = _Last(int(number[-1]), int(t_ns[-1]), int(sequence[-1]), int(time[-1]))
        return Numbered(number, duplicate, conflict, jump)

    def _same(self, codes: np.ndarray) -> BoolArray:
        """Which samples have the codes of the one before."""
        before = codes[:1] if self._codes is None else self._codes
        self._codes = codes[-1:]
        earlier = np.concatenate([before, codes[:-1]])
        return np.asarray((codes == earlier).all(axis=1), np.bool_)

    def _by_counter(self, d_sequence: IntArray, d_host: IntArray) -> tuple[IntArray, BoolArray]:
        """Steps by the counter, and where it stands still."""
        turn = self._clocks.counter_modulus
        d_sequence %= turn
        still = (d_sequence == 0) & (d_host < turn // 2)
        turns = np.rint((d_host - d_sequence) / turn).astype(np.int64)
        return d_sequence + turn * turns, still

    def _by_clock(
        self, d_time: IntArray, d_host_s: FloatArray, d_host: IntArray
    ) -> tuple[IntArray, BoolArray]:
        """Steps by the unit's clock, and where it stands still."""
        clocks = self._clocks
        turn_us = clocks.time_turn * clocks.tick_us
        passed_us = d_time * clocks.tick_us
        passed_us = passed_us + turn_us * np.rint((d_host_s * 1e6 - passed_us) / turn_us)
        still = (d_time == 0) & (d_host < turn_us * 1e-6 * clocks.rate_hz / 2)
        return np.rint(passed_us * 1e-6 * clocks.rate_hz).astype(np.int64), still

    def _off_clock(self, d_time: IntArray, step: IntArray) -> BoolArray:
        """Where the unit's clock does not agree with the steps."""
        clocks = self._clocks
        period_us, turn_us = 1e6 / clocks.rate_hz, clocks.time_turn * clocks.tick_us
        half_us = turn_us / 2
        off_us = np.abs((d_time * clocks.tick_us - step * period_us + half_us) % turn_us - half_us)
        limit_us = period_us / 4 + clocks.tick_us + step * period_us * CLOCK_ERROR
        return np.asarray(off_us > limit_us, np.bool_)

    def _crowded(self, t_ns: IntArray) -> BoolArray:
        """Which samples end a second's number of samples that came in much less."""
        rate_hz = self._clocks.rate_hz
        every = np.concatenate([self._recent, t_ns])
        crowded = np.zeros(len(t_ns), np.bool_)
        spans = every[rate_hz:] - every[:-rate_hz]
        if len(spans):
            crowded[len(crowded) - len(spans) :] = spans < _CROWDED * 1e9
        self._recent = every[-rate_hz:]
        return crowded


def _steps(column: IntArray, before: int) -> IntArray:
    """Steps of a column (n,), the first from the number before it."""
    steps = np.empty(len(column), np.int64)
    steps[0] = column[0] - before
    np.subtract(column[1:], column[:-1], out=steps[1:])
    return steps
