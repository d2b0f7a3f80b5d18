"""Whether the temperature rests."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from triaxcal.rig.plan.plan import Thermal
from triaxcal.rig.session.blocks import Block
from triaxcal.unit.thermometer import TemperatureSensor

_COVERED = 0.9
"""Share of the window's seconds that must have a temperature."""


@dataclass(frozen=True)
class Trend:
    """Trend of the temperature over a window.

    Attributes
    ----------
    slope_k_per_min, u_k_per_min : float
        dT/dt and its standard uncertainty.
    """

    slope_k_per_min: float
    u_k_per_min: float

    def rests(self, settings: Thermal) -> bool:
        """|dT/dt| + 2u within the limit."""
        return abs(self.slope_k_per_min) + 2.0 * self.u_k_per_min <= settings.slope_max_k_per_min


def window_s(settings: Thermal) -> int:
    """Seconds of the window: whole cycles of a chamber that cycles, two at least."""
    if not settings.cycle_s:
        return settings.window_s
    return settings.cycle_s * max(2, math.ceil(settings.window_s / settings.cycle_s))


def trend(t_s: Sequence[float], temp_degc: Sequence[float], settings: Thermal) -> Trend:
    """Straight line through temperatures, with the chamber's cycle as sine and cosine beside it.

    Residuals follow one another; their number is reduced by their correlation r to
    n (1 - r) / (1 + r), or u would be far too small.
    """
    t = np.asarray(t_s, np.float64)
    t -= t.mean()
    columns = [np.ones_like(t), t]
    if settings.cycle_s:
        phase = 2.0 * math.pi * t / settings.cycle_s
        columns += [np.sin(phase), np.cos(phase)]
    design = np.stack(columns, axis=1)
    temp = np.asarray(temp_degc, np.float64)
    solution, *_ = np.linalg.lstsq(design, temp, rcond=None)
    rest = temp - design @ solution
    squares = float(rest @ rest)
    count = len(t)
    r = max(0.0, float(rest[1:] @ rest[:-1]) / squares) if squares > 0.0 else 0.0
    effective = max(count * (1.0 - r) / (1.0 + r) - design.shape[1], 1.0)
    inverse = np.linalg.pinv(design.T @ design)[1, 1]
    u = math.sqrt(squares / effective * inverse)
    return Trend(60.0 * float(solution[1]), 60.0 * u)


def time_left_s(now: Trend, before: Trend, apart_s: float, settings: Thermal) -> float | None:
    """Seconds until the slope falls to the limit, tau ln(slope / limit).

    The time constant is taken from two slopes `apart_s` seconds apart; None when the slope does
    not fall.
    """
    slope, earlier = abs(now.slope_k_per_min), abs(before.slope_k_per_min)
    limit = settings.slope_max_k_per_min
    if slope <= limit:
        return 0.0
    if earlier <= slope * 1.001:
        return None
    return apart_s / math.log(earlier / slope) * math.log(slope / limit)


class Thermometer:
    """Temperatures of the window's seconds, and the trends of the last minute."""

    def __init__(self, settings: Thermal, sensor: TemperatureSensor) -> None:
        self._settings = settings
        self._sensor = sensor
        self._temps: deque[tuple[int, float]] = deque()
        self._trends: deque[tuple[int, Trend]] = deque(maxlen=60)
        self.window_s = window_s(settings)

    @property
    def temp_degc(self) -> float | None:
        """Latest temperature."""
        return self._temps[-1][1] if self._temps else None

    @property
    def trend(self) -> Trend | None:
        """Latest trend."""
        return self._trends[-1][1] if self._trends else None

    @property
    def rests(self) -> bool:
        """The temperature rests."""
        return self.trend is not None and self.trend.rests(self._settings)

    @property
    def seconds(self) -> int:
        """Seconds of the window that have a temperature."""
        return len(self._temps)

    @property
    def left_s(self) -> float | None:
        """Estimate of the seconds until it rests; None when there is none."""
        if len(self._trends) < 30:
            return None
        (t_before, before), (t_now, now) = self._trends[0], self._trends[-1]
        return time_left_s(now, before, t_now - t_before, self._settings)

    def take(self, block: Block) -> None:
        """Take the temperature of one more second."""
        if self._temps and block.index <= self._temps[-1][0]:
            self._temps.clear()
        if block.temp_code is not None:
            self._temps.append((block.index, self._sensor.degc(block.temp_code)))
        while self._temps and self._temps[0][0] <= block.index - self.window_s:
            self._temps.popleft()
        if len(self._temps) >= _COVERED * self.window_s:
            seconds, degrees = zip(*self._temps, strict=True)
            self._trends.append((block.index, trend(seconds, degrees, self._settings)))
        else:
            self._trends.clear()
