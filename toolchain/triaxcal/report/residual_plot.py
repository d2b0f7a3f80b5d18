"""residuals.svg: | |a| - g | at the unit's own dwells, before and after; P1 figures 5 and 6."""

from __future__ import annotations

import math
from dataclasses import dataclass

from triaxcal.codegen.render import environment
from triaxcal.codegen.tryout import BEFORE, MethodResult
from triaxcal.delivery import Delivery
from triaxcal.report.temperatures import by_temperature

PANEL_WIDTH, PANEL_HEIGHT = 132.0, 260.0
LEFT, TOP, GAP = 64.0, 64.0, 10.0
FLOOR_MG = 1e-5
"""Errors below this are drawn on the lowest line: a code of a 24-bit converter is more."""

COLOURS = {
    BEFORE: "#8a8a8a",
    "matrix": "#0a5fb4",
    "inverse": "#2a9d8f",
    "additive": "#c8553d",
    "additive-simplified": "#e9a23b",
    "additive-first-order": "#7b4ea3",
}


@dataclass(frozen=True)
class _Scale:
    """Logarithmic axis from 10^low to 10^high mg, top down."""

    low: int
    high: int

    def y(self, error_mg: float) -> float:
        exponent = math.log10(max(abs(error_mg), 10.0**self.low))
        return TOP + PANEL_HEIGHT * (self.high - exponent) / (self.high - self.low)


def residuals_svg(delivery: Delivery) -> bytes:
    """Draw one panel a temperature, one line a method, on a logarithmic axis in mg."""
    methods = [m for m in delivery.methods if m.residuals]
    panels = [
        (f"{temp:+.0f} degC", indices)
        for prefix in ("TP", "CP")
        for temp, indices in by_temperature(methods[0], prefix)
    ]
    largest_mg = max(abs(r.error_g) * 1e3 for m in methods for r in m.residuals)
    scale = _Scale(round(math.log10(FLOOR_MG)), math.ceil(math.log10(max(largest_mg, 1.0))))
    limits = delivery.unit.limits
    context = {
        "title": f"{delivery.unit.name}: | |a| - g | before and after compensation, mg",
        "width": LEFT + len(panels) * (PANEL_WIDTH + GAP) + GAP,
        "height": TOP + PANEL_HEIGHT + 46,
        "left": LEFT,
        "right": LEFT + len(panels) * (PANEL_WIDTH + GAP) - GAP,
        "top": TOP,
        "bottom": TOP + PANEL_HEIGHT,
        "ticks": [
            {"y": _r(scale.y(10.0**e)), "label": f"{10.0**e:g}"}
            for e in range(scale.low, scale.high + 1)
        ],
        "panels": [
            {"title": title, **_panel(LEFT + i * (PANEL_WIDTH + GAP), indices, delivery, scale)}
            for i, (title, indices) in enumerate(panels)
        ],
        "legend": _legend(methods, delivery.unit.method),
        "limits": [
            {"y": _r(scale.y(limits.at_t0_g * 1e3)), "label": "limit at T0"},
            {"y": _r(scale.y(limits.over_range_g * 1e3)), "label": "limit over the range"},
        ],
    }
    return environment().get_template("residuals.svg.j2").render(context).encode()


def _panel(x0: float, indices: list[int], delivery: Delivery, scale: _Scale) -> dict[str, object]:
    methods = [m for m in delivery.methods if m.residuals]
    indices = sorted(indices, key=lambda i: methods[0].residuals[i].dwell.position)
    xs = [_r(x0 + PANEL_WIDTH * (k + 0.5) / len(indices)) for k in range(len(indices))]
    lines = []
    for method in sorted(methods, key=lambda m: m.method == delivery.unit.method):
        ys = [_r(scale.y(method.residuals[i].error_g * 1e3)) for i in indices]
        lines.append(
            {
                "colour": COLOURS[method.method],
                "width": 2.4 if method.method == delivery.unit.method else 1.2,
                "points": list(zip(xs, ys, strict=True)),
            }
        )
    labels = [methods[0].residuals[i].dwell.position for i in indices]
    return {
        "x": _r(x0),
        "middle": _r(x0 + PANEL_WIDTH / 2),
        "width": PANEL_WIDTH,
        "height": PANEL_HEIGHT,
        "lines": lines,
        "labels": list(zip(xs, labels, strict=True)),
    }


def _legend(methods: list[MethodResult], chosen: str) -> list[dict[str, object]]:
    entries, x = [], LEFT
    for method in methods:
        label = method.method + (" (delivered)" if method.method == chosen else "")
        entries.append({"x": x, "label": label, "colour": COLOURS[method.method]})
        x += 34 + 6.6 * len(label)
    return entries


def _r(value: float) -> float:
    return round(value, 2)
