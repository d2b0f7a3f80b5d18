"""Small pictures: the twelve curves with points and bands, and uncertainty over temperature."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from triaxcal.fitting.core.calibration import Calibration
from triaxcal.model.metrological import CONSTANT_NAMES
from triaxcal.model.types import FloatArray
from triaxcal.report.words.numbers import handy, in_unit, signed
from triaxcal.uncertainty.evaluate import Uncertainty

WIDTH, HEIGHT = 232.0, 150.0
LEFT, RIGHT, TOP, BOTTOM = 52.0, 16.0, 8.0, 20.0
ORDER = (0, 1, 2, 9, 3, 4, 5, 10, 6, 7, 8, 11)
"""A row of panels an output: its three sensitivities and its bias."""


@dataclass(frozen=True)
class Frame:
    """Linear axes of one panel: data to drawing."""

    x_range: tuple[float, float]
    y_range: tuple[float, float]
    width: float = WIDTH
    height: float = HEIGHT
    left: float = LEFT

    def x(self, value: float) -> float:
        """Horizontal position."""
        low, high = self.x_range
        span = self.width - self.left - RIGHT
        return round(self.left + span * (value - low) / (high - low), 2)

    def y(self, value: float) -> float:
        """Vertical position."""
        low, high = self.y_range
        return round(TOP + (self.height - TOP - BOTTOM) * (high - value) / (high - low), 2)

    def points(self, xs: Sequence[float], ys: Sequence[float]) -> str:
        """Coordinates of a polyline."""
        return " ".join(f"{self.x(x)},{self.y(y)}" for x, y in zip(xs, ys, strict=True))


def ticks(low: float, high: float, count: int) -> list[float]:
    """About `count` round numbers from low to high."""
    span = (high - low) or 1.0
    power = 10.0 ** math.floor(math.log10(span / count))
    step = next(power * f for f in (1, 2, 2.5, 5, 10) if power * f * count >= span)
    first = math.ceil(low / step - 1e-9)
    return [round(k * step, 12) for k in range(first, math.floor(high / step + 1e-9) + 1)]


def curve_panels(calibration: Calibration, u: Uncertainty) -> list[dict[str, Any]]:
    """Context of the twelve panels: change since T0 in handy units, points, curve, band."""
    units = u.units
    scale = handy(units[9])[1]
    curves = calibration.thermal.constants_at(u.temps_degc) * scale
    at_t0 = calibration.thermal.constants_at(calibration.thermal.t0_degc) * scale
    bands = u.constants_u * scale
    points = np.array([q.constants for q in calibration.points]) * scale
    temps = [q.temp_degc for q in calibration.points]
    return [
        {
            "name": CONSTANT_NAMES[c],
            "unit": handy(units[c])[0],
            "note": "± " + in_unit(float(bands[:, c].max()) / scale, units[c]),
            **_panel(
                u.temps_degc, curves[:, c] - at_t0[c], bands[:, c], temps, points[:, c] - at_t0[c]
            ),
        }
        for c in ORDER
    ]


def _panel(
    temps: FloatArray, curve: FloatArray, band: FloatArray, at: list[float], points: FloatArray
) -> dict[str, Any]:
    low = float(min((curve - band).min(), points.min()))
    high = float(max((curve + band).max(), points.max()))
    margin = 0.06 * (high - low) or 1.0
    frame = Frame((float(temps[0]), float(temps[-1])), (low - margin, high + margin))
    xs = [float(t) for t in temps]
    back = frame.points(xs[::-1], (curve - band)[::-1].tolist())
    return {
        "curve": frame.points(xs, curve.tolist()),
        "band": frame.points(xs, (curve + band).tolist()) + " " + back,
        "points": [
            {"x": frame.x(t), "y": frame.y(float(v))} for t, v in zip(at, points, strict=True)
        ],
        "zero": frame.y(0.0),
        "x_ticks": x_ticks(frame),
        "y_ticks": y_ticks(frame, 4),
    }


def x_ticks(frame: Frame) -> list[dict[str, Any]]:
    """Temperatures below a panel."""
    return [
        {"x": frame.x(t), "label": signed(f"{t:g}")}
        for t in ticks(*frame.x_range, 5 if frame.width < 400 else 10)
    ]


def y_ticks(frame: Frame, count: int) -> list[dict[str, Any]]:
    """Values beside a panel."""
    return [
        {"y": frame.y(v), "label": signed(f"{v:g}" if abs(v) < 1e5 else f"{v:.0e}")}
        for v in ticks(*frame.y_range, count)
    ]


def uncertainty_panel(calibration: Calibration, u: Uncertainty) -> dict[str, Any]:
    """Context of the picture of the expanded uncertainty over temperature, in µg."""
    worst = u.worst_over_temperature * 1e6
    components = worst[:, :3].max(axis=1)
    temps = u.temps_degc
    xs = [float(t) for t in temps]
    high = float(worst.max()) * 1.08 or 1.0
    frame = Frame((xs[0], xs[-1]), (0.0, high), width=700.0, height=190.0, left=56.0)
    return {
        "width": frame.width,
        "height": frame.height,
        "left": frame.left,
        "component": frame.points(xs, components.tolist()),
        "length": frame.points(xs, worst[:, 3].tolist()),
        "x_ticks": x_ticks(frame),
        "y_ticks": y_ticks(frame, 5),
        "calibrated": [frame.x(q.temp_degc) for q in calibration.points],
    }
