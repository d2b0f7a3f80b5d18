"""residuals.svg: | |a| - g | at the unit's own dwells, before and after; P1 figures 5 and 6."""

from __future__ import annotations

import math
from dataclasses import dataclass

from triaxcal.codegen.templates import environment
from triaxcal.codegen.tryout import MethodResult
from triaxcal.delivery.unit import Delivery
from triaxcal.report.words.temperatures import by_temperature, degrees, position_order, with_room
from triaxcal.unit.limits import Limits

WIDTH = 960.0
LEFT, RIGHT, TOP, GAP = 64.0, 16.0, 84.0, 8.0
PANEL_HEIGHT, ROW_HEIGHT = 230.0, 290.0
PANELS_PER_ROW = 8
LETTER_WIDTH, LABEL_HEIGHT = 4.4, 10.0
"""Of the labels' letters, 8 px high."""
FLOOR_MG = 1e-5
"""Errors below this are drawn on the lowest line: a code of a 24-bit converter is more."""


@dataclass(frozen=True)
class _Scale:
    """Logarithmic axis from 10^high at `top` down to 10^low mg."""

    low: int
    high: int
    top: float

    def y(self, error_mg: float) -> float:
        exponent = math.log10(max(abs(error_mg), 10.0**self.low))
        return _r(self.top + PANEL_HEIGHT * (self.high - exponent) / (self.high - self.low))


def residuals_svg(delivery: Delivery) -> bytes:
    """Draw a row of panels for test and one for check positions, one panel a temperature.

    One line a method, on a logarithmic axis in mg.
    """
    methods = [m for m in delivery.methods if m.residuals]
    limits = delivery.unit.limits
    largest_mg = max(abs(r.error_g) * 1e3 for m in methods for r in m.residuals)
    largest_mg = max(largest_mg, 1.0, limits.at_t0_g * 1e3, limits.over_range_g * 1e3)
    high = math.ceil(math.log10(largest_mg))
    rows: list[dict[str, object]] = []
    for prefix, title in (
        ("TP", "test positions, fitted"),
        ("CP", "check positions, held out"),
        ("P", "poses, fitted"),
    ):
        groups = by_temperature(methods[0], prefix)
        for first in range(0, len(groups), PANELS_PER_ROW):
            scale = _Scale(round(math.log10(FLOOR_MG)), high, TOP + len(rows) * ROW_HEIGHT)
            row = _row(groups[first : first + PANELS_PER_ROW], delivery, scale)
            rows.append({"title": title, **row})
    context = {
        "title": f"{delivery.unit.name}: | |a| - g | with the constants of T0, and compensated, mg",
        "width": WIDTH,
        "height": TOP + len(rows) * ROW_HEIGHT,
        "left": LEFT,
        "right": WIDTH - RIGHT,
        "panel_height": PANEL_HEIGHT,
        "floor": f"{FLOOR_MG:.5f}",
        "rows": rows,
        "legend": _legend(methods, delivery.chosen),
    }
    return environment().get_template("pictures/residuals.svg.j2").render(context).encode()


def _row(
    groups: list[tuple[float, list[int]]], delivery: Delivery, scale: _Scale
) -> dict[str, object]:
    width = (WIDTH - LEFT - RIGHT - GAP * (len(groups) - 1)) / len(groups)
    limits = delivery.unit.limits
    return {
        "top": scale.top,
        "bottom": scale.top + PANEL_HEIGHT,
        "ticks": [
            {"y": scale.y(10.0**e), "label": f"{10.0**e:f}".rstrip("0").rstrip(".")}
            for e in range(scale.low, scale.high + 1)
        ],
        "panels": [
            {
                "title": f"{degrees(temp)} degC",
                "width": _r(width),
                **_panel(LEFT + i * (width + GAP), width, indices, delivery, scale),
            }
            for i, (temp, indices) in enumerate(groups)
        ],
        "limits": _limits(limits, scale),
    }


def _limits(limits: Limits, scale: _Scale) -> list[dict[str, object]]:
    """Both limits, or one line where their words would lie on each other."""
    t0, other = scale.y(limits.at_t0_g * 1e3), scale.y(limits.over_range_g * 1e3)
    if t0 == other:
        return [{"y": t0, "label": "limit at T0 and over the range", "shift": -3.0}]
    # Of two that are near, the lower line has its words below.
    below = 12.0 if abs(t0 - other) < LABEL_HEIGHT else -3.0
    return [
        {"y": t0, "label": "limit at T0", "shift": below if t0 > other else -3.0},
        {"y": other, "label": "limit over the range", "shift": below if other > t0 else -3.0},
    ]


def _thinned(xs: list[float], labels: list[str], width: float) -> list[tuple[float, str]]:
    """Labels below a panel, as many as have room."""
    kept = with_room(labels, width / len(labels), LETTER_WIDTH)
    return [(x, label) for x, label in zip(xs, kept, strict=True) if label]


def _panel(
    x0: float, width: float, indices: list[int], delivery: Delivery, scale: _Scale
) -> dict[str, object]:
    methods = [m for m in delivery.methods if m.residuals]
    indices = sorted(indices, key=lambda i: position_order(methods[0].residuals[i].dwell.position))
    xs = [_r(x0 + width * (k + 0.5) / len(indices)) for k in range(len(indices))]
    lines = []
    for method in sorted(methods, key=lambda m: m is delivery.chosen):
        ys = [scale.y(method.residuals[i].error_g * 1e3) for i in indices]
        lines.append(
            {
                "colour": method.method.colour,
                "width": 2.4 if method is delivery.chosen else 1.2,
                "points": list(zip(xs, ys, strict=True)),
            }
        )
    labels = [methods[0].residuals[i].dwell.position for i in indices]
    return {
        "x": _r(x0),
        "middle": _r(x0 + width / 2),
        "lines": lines,
        "labels": _thinned(xs, labels, width),
    }


def _legend(methods: list[MethodResult], chosen: MethodResult) -> list[dict[str, object]]:
    entries, x = [], LEFT
    for method in methods:
        label = method.method.label + (" (delivered)" if method is chosen else "")
        entries.append({"x": _r(x), "label": label, "colour": method.method.colour})
        x += 34 + 6.6 * len(label)
    return entries


def _r(value: float) -> float:
    return round(value, 2)
