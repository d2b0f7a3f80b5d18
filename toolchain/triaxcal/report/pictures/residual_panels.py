"""Residuals before and after per position and temperature: P1, figures 5 and 6, in one picture."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from triaxcal.codegen.tryout import BEFORE, Residual
from triaxcal.delivery.unit import Delivery
from triaxcal.report.words.numbers import signed
from triaxcal.report.words.temperatures import by_temperature, degrees, position_order, with_room

WIDTH, LEFT, RIGHT = 700.0, 56.0, 6.0
PLOT, HEAD, FOOT = 150.0, 24.0, 26.0
LETTER_WIDTH = 5.6
FLOOR_MG = 1e-5
"""Errors below this are drawn on the lowest line: a code of a 24-bit converter is more."""


@dataclass(frozen=True)
class _Axis:
    """Logarithmic axis of |error| in mg, from 10^low to 10^high."""

    low: int
    high: int

    def y(self, error_g: float) -> float:
        exponent = math.log10(max(abs(error_g) * 1e3, 10.0**self.low))
        return round(HEAD + PLOT * (self.high - exponent) / (self.high - self.low), 2)


def residual_panels(delivery: Delivery) -> list[dict[str, Any]]:
    """Context of one picture for test and one for check positions, a column a temperature."""
    before = next(m for m in delivery.methods if m.method is BEFORE)
    largest = max(abs(r.error_g) for m in (before, delivery.chosen) for r in m.residuals)
    axis = _Axis(round(math.log10(FLOOR_MG)), math.ceil(math.log10(max(largest * 1e3, 1.0))))
    rows = []
    for prefix, title in (
        ("TP", "Test positions (fitted)"),
        ("CP", "Check positions (held out)"),
        ("P", "Poses of the recording (fitted)"),
    ):
        groups = by_temperature(before, prefix)
        if groups:
            rows.append({"title": title, **_row(delivery, before.residuals, groups, axis)})
    return rows


def _row(
    delivery: Delivery,
    before: tuple[Residual, ...],
    groups: list[tuple[float, list[int]]],
    axis: _Axis,
) -> dict[str, Any]:
    limits = delivery.unit.limits
    span = (WIDTH - LEFT - RIGHT) / len(groups)
    columns = []
    for k, (temp, indices) in enumerate(groups):
        x0 = LEFT + k * span
        step = (span - 10.0) / len(indices)
        ordered = sorted(indices, key=lambda i: position_order(before[i].dwell.position))
        numbers = [before[i].dwell.position.lstrip("TCP") for i in ordered]
        labels = with_room(numbers, step, LETTER_WIDTH)
        columns.append(
            {
                "x": round(x0, 2),
                "middle": round(x0 + span / 2, 2),
                "end": round(x0 + span, 2),
                "title": signed(degrees(temp)) + " °C",
                "limit": axis.y(limits.at(temp, delivery.unit.t0_degc)[0]),
                "marks": [
                    {
                        "x": round(x0 + 5.0 + step * (n + 0.5), 2),
                        "before": axis.y(before[i].error_g),
                        "after": axis.y(delivery.chosen.residuals[i].error_g),
                        "label": labels[n],
                    }
                    for n, i in enumerate(ordered)
                ],
            }
        )
    return {
        "height": HEAD + PLOT + FOOT,
        "bottom": HEAD + PLOT,
        "columns": columns,
        "ticks": [
            {"y": axis.y(10.0 ** (e - 3)), "label": _label(e)}
            for e in range(axis.low, axis.high + 1)
        ],
    }


def _label(exponent: int) -> str:
    """10^exponent mg in a short unit."""
    if exponent >= 0:
        return f"{10**exponent} mg"
    return f"{10 ** (exponent + 3)} µg" if exponent >= -3 else f"{10 ** (exponent + 6)} ng"
