"""Small pictures: the twelve curves with points and bands, and uncertainty over temperature."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from triaxcal.fitting.core.calibration import Calibration
from triaxcal.model.metrological import CONSTANT_NAMES
from triaxcal.model.types import FloatArray
from triaxcal.report.texts.speaker import Speaker
from triaxcal.report.words.numbers import handy, in_unit, signed, significant
from triaxcal.uncertainty.evaluate import Uncertainty

WIDTH, HEIGHT = 232.0, 150.0
LEFT, RIGHT, TOP, BOTTOM = 52.0, 16.0, 8.0, 20.0
ORDER = (0, 1, 2, 9, 3, 4, 5, 10, 6, 7, 8, 11)
"""A row of panels an output: its three sensitivities and its bias."""
_MANY_POINTS = 20
"""Of a curve: beyond it they are drawn smaller."""
_SPOTS = 30
"""Temperatures whose uncertainties can be read from the picture."""


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


def curve_panels(calibration: Calibration, u: Uncertainty, t: Speaker) -> list[dict[str, Any]]:
    """Context of the twelve panels: change since T0 in handy units, points, curve, band."""
    scale = handy(u.units[9])[1]
    at_t0 = calibration.thermal.constants_at(calibration.thermal.t0_degc)
    curves = (calibration.thermal.constants_at(u.temps_degc) - at_t0) * scale
    points = (np.array([q.constants for q in calibration.points]) - at_t0) * scale
    bands = u.constants_u * scale
    t0 = signed(f"{calibration.thermal.t0_degc:g}")
    dense = len(points) > _MANY_POINTS
    panels = []
    for c in ORDER:
        name, unit = CONSTANT_NAMES[c], handy(u.units[c])[0]
        panels.append(
            {
                "name": name,
                "unit": unit,
                "alt": t("curves.alt", name=name, t0=t0, unit=unit),
                "note": "± " + in_unit(float(u.constants_u[:, c].max()), u.units[c]),
                "radius": 1.7 if dense else 3,
                "outline": 0.8 if dense else 1.3,
                **_panel(u.temps_degc, curves[:, c], bands[:, c], points[:, c]),
            }
        )
        frame = panels[-1].pop("frame")
        panels[-1]["points"] = [
            {
                "x": frame.x(q.temp_degc),
                "y": frame.y(value),
                "words": t(
                    "curves.point",
                    temp=signed(f"{q.temp_degc:.4g}"),
                    value=signed(f"{value:+.4g}"),
                    unit=unit,
                ),
            }
            for q, value in zip(calibration.points, points[:, c].tolist(), strict=True)
        ]
    return panels


def _panel(
    temps: FloatArray, curve: FloatArray, band: FloatArray, points: FloatArray
) -> dict[str, Any]:
    """Frame, curve, band and axes of one panel."""
    low = float(min((curve - band).min(), points.min()))
    high = float(max((curve + band).max(), points.max()))
    margin = 0.06 * (high - low) or 1.0
    frame = Frame((float(temps[0]), float(temps[-1])), (low - margin, high + margin))
    xs = [float(t) for t in temps]
    back = frame.points(xs[::-1], (curve - band)[::-1].tolist())
    return {
        "frame": frame,
        "curve": frame.points(xs, curve.tolist()),
        "band": frame.points(xs, (curve + band).tolist()) + " " + back,
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


def uncertainty_panel(calibration: Calibration, u: Uncertainty, t: Speaker) -> dict[str, Any]:
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
        "dash_from": 8 if len(calibration.points) <= _MANY_POINTS else 162,
        "spots": _spots(frame, xs, components.tolist(), worst[:, 3].tolist(), t),
    }


def _spots(
    frame: Frame, temps: list[float], component: list[float], length: list[float], t: Speaker
) -> list[dict[str, Any]]:
    """Upright strips of the picture, each with the values in its middle."""
    step = max(1, len(temps) // _SPOTS)
    chosen = range(0, len(temps), step)
    middles = [frame.x(temps[k]) for k in chosen]
    edges = [(a + b) / 2.0 for a, b in itertools.pairwise(middles)]
    return [
        {
            "x": round(low, 2),
            "width": round(high - low, 2),
            "words": t(
                "uncertainty.spot",
                temp=signed(f"{temps[k]:.3g}"),
                component=f"{significant(component[k])} µg",
                length=f"{significant(length[k])} µg",
            ),
        }
        for k, low, high in zip(chosen, [middles[0], *edges], [*edges, middles[-1]], strict=True)
    ]
