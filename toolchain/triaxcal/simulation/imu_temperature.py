"""The temperature inside a simulated IMU over time."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from triaxcal.model.types import FloatArray


@dataclass(frozen=True)
class TemperatureDrift:
    """Inside the unit: start + (end - start)(1 - exp(-t/tau)) + wave sin(2 pi t/period).

    Attributes
    ----------
    start_degc, end_degc, tau_s, wave_degc, period_s : float
    """

    start_degc: float = 20.0
    end_degc: float = 20.0
    tau_s: float = 2400.0
    wave_degc: float = 0.0
    period_s: float = 1700.0

    def at(self, time_s: FloatArray) -> FloatArray:
        """Temperature in degC, same shape as the times."""
        drift = (self.end_degc - self.start_degc) * -np.expm1(-time_s / self.tau_s)
        wave = self.wave_degc * np.sin(2.0 * math.pi / self.period_s * time_s)
        result: FloatArray = self.start_degc + drift + wave
        return result


CONSTANT = TemperatureDrift()


@dataclass(frozen=True)
class TemperatureRamp:
    """Steadily from one temperature to another, and there it stays.

    Attributes
    ----------
    start_degc, end_degc, duration_s : float
    """

    start_degc: float
    end_degc: float
    duration_s: float

    def at(self, time_s: FloatArray) -> FloatArray:
        """Temperature in degC, same shape as the times."""
        part = np.clip(time_s / self.duration_s, 0.0, 1.0)
        result: FloatArray = self.start_degc + (self.end_degc - self.start_degc) * part
        return result


WARMING = TemperatureDrift(start_degc=20.0, end_degc=45.0, wave_degc=3.0)
"""Switched on cold, beside an air conditioner."""

SWEPT = TemperatureDrift(start_degc=22.5, end_degc=22.5, wave_degc=62.5, period_s=240.0)
"""-40 to 85 degC and back, again and again: faster than any chamber."""
