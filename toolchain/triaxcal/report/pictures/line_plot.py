"""Lines over a common axis, panels below each other: one SVG for poses, drift and convergence."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from triaxcal.codegen.templates import environment
from triaxcal.model.types import FloatArray
from triaxcal.report.pictures.curves import ticks

WIDTH, LEFT, RIGHT, TOP = 960.0, 80.0, 16.0, 76.0
HEIGHT, FOOT = 190.0, 62.0
POINTS_MAX = 1600
COLOURS = ("#0a5fb4", "#c8553d", "#2a9d8f", "#7b4ea3")
GOOD, BAD = "#e3f2e6", "#fbe3dc"


@dataclass(frozen=True)
class Line:
    """One polyline; lines of one label share an entry in the legend."""

    label: str
    colour: str
    x: FloatArray
    y: FloatArray
    dashed: bool = False


@dataclass(frozen=True)
class Band:
    """A coloured stretch of the axis."""

    start: float
    stop: float
    colour: str
    label: str = ""


@dataclass(frozen=True)
class Panel:
    """Lines and bands of one picture; `y_range` None takes in all lines.

    `powers`: both axes have scales of powers of ten; values are above 0.
    """

    title: str
    x_label: str
    lines: Sequence[Line]
    bands: Sequence[Band] = ()
    y_range: tuple[float, float] | None = None
    powers: bool = False


def line_plot(title: str, panels: Sequence[Panel]) -> bytes:
    """SVG of the panels."""
    context = {
        "title": title,
        "width": WIDTH,
        "height": TOP + len(panels) * (HEIGHT + FOOT),
        "left": LEFT,
        "right": WIDTH - RIGHT,
        "legend": _legend(panels),
        "panels": [_panel(p, TOP + k * (HEIGHT + FOOT)) for k, p in enumerate(panels)],
    }
    return environment().get_template("pictures/lines.svg.j2").render(context).encode()


def _legend(panels: Sequence[Panel]) -> list[dict[str, Any]]:
    entries: dict[str, dict[str, Any]] = {}
    x = LEFT
    for line in (line for panel in panels for line in panel.lines):
        if line.label and line.label not in entries:
            entries[line.label] = {
                "x": round(x, 1),
                "label": line.label,
                "colour": line.colour,
                "dashed": line.dashed,
            }
            x += 46.0 + 6.2 * len(line.label)
    return list(entries.values())


def _panel(panel: Panel, top: float) -> dict[str, Any]:
    if panel.powers:
        lines = [replace(li, x=np.log10(li.x), y=np.log10(li.y)) for li in panel.lines]
        panel = replace(panel, lines=lines)
    xs = np.concatenate([line.x for line in panel.lines])
    ys = np.concatenate([line.y for line in panel.lines])
    x_low, x_high = float(xs.min()), float(xs.max())
    low, high = panel.y_range or _padded(float(ys.min()), float(ys.max()))
    x_span = (x_high - x_low) or 1.0

    def x_at(value: float) -> float:
        return round(LEFT + (WIDTH - LEFT - RIGHT) * (value - x_low) / x_span, 1)

    def y_at(value: float) -> float:
        inside = min(max(value, low), high)
        return round(top + HEIGHT * (high - inside) / (high - low), 1)

    return {
        "title": panel.title,
        "x_label": panel.x_label,
        "top": top,
        "bottom": top + HEIGHT,
        "height": HEIGHT,
        "x_ticks": [{"at": x_at(t), "label": n} for t, n in _ticks(panel, x_low, x_high, 8)],
        "y_ticks": [{"at": y_at(t), "label": n} for t, n in _ticks(panel, low, high, 5)],
        "bands": [
            {
                "x": x_at(b.start),
                "width": round(x_at(b.stop) - x_at(b.start), 1),
                "colour": b.colour,
                "label": b.label,
            }
            for b in panel.bands
        ],
        "lines": [
            {"colour": line.colour, "dashed": line.dashed, "points": _points(line, x_at, y_at)}
            for line in panel.lines
        ],
    }


def _ticks(panel: Panel, low: float, high: float, count: int) -> list[tuple[float, str]]:
    """Where ticks are, and what stands there; of powers of ten at 1, 2, 5, or 1 where many."""
    if not panel.powers:
        return [(t, f"{t:g}") for t in ticks(low, high, count)]
    decades = range(math.floor(low), math.ceil(high) + 1)
    digits = (1, 2, 5) if high - low < 3.0 else (1,)
    every = [d * 10.0**k for k in decades for d in digits]
    return [(math.log10(v), f"{v:g}") for v in every if low <= math.log10(v) <= high]


def _padded(low: float, high: float) -> tuple[float, float]:
    room = 0.06 * (high - low) or max(abs(high), 1.0)
    return low - room, high + room


def _points(line: Line, x_at: Any, y_at: Any) -> str:
    step = max(1, len(line.x) // POINTS_MAX)
    pairs = zip(line.x[::step].tolist(), line.y[::step].tolist(), strict=True)
    return " ".join(f"{x_at(x)},{y_at(y)}" for x, y in pairs)
