"""Residuals before and after per position and temperature: P1, figures 5 and 6, in one picture."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from triaxcal.codegen.tryout import BEFORE, Residual
from triaxcal.delivery.unit import Delivery
from triaxcal.report.texts.speaker import Speaker
from triaxcal.report.words.numbers import g_in_words, signed
from triaxcal.report.words.temperatures import by_temperature, degrees, position_order, with_room

WIDTH, LEFT, RIGHT = 700.0, 56.0, 6.0
PLOT, HEAD, FOOT = 150.0, 24.0, 26.0
LETTER_WIDTH = 5.6
_CLOSE = 4.0
"""Between marks: nearer ones are drawn smaller."""
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


def residual_panels(delivery: Delivery, t: Speaker) -> list[dict[str, Any]]:
    """Context of one picture for test and one for check positions, a column a temperature."""
    before = next(m for m in delivery.methods if m.method is BEFORE)
    largest = max(abs(r.error_g) for m in (before, delivery.chosen) for r in m.residuals)
    axis = _Axis(round(math.log10(FLOOR_MG)), math.ceil(math.log10(max(largest * 1e3, 1.0))))
    rows = []
    for prefix, title in (
        ("TP", t("residuals.tests")),
        ("CP", t("residuals.checks")),
        ("P", t("residuals.poses")),
    ):
        groups = by_temperature(before, prefix)
        if groups:
            rows.append({"title": title, **_row(delivery, before.residuals, groups, axis, t)})
    return rows


def _row(
    delivery: Delivery,
    before: tuple[Residual, ...],
    groups: list[tuple[float, list[int]]],
    axis: _Axis,
    t: Speaker,
) -> dict[str, Any]:
    limits = delivery.unit.limits
    span = (WIDTH - LEFT - RIGHT) / len(groups)
    room = min(10.0, 0.2 * span)
    titles = with_room([signed(degrees(temp)) + " °C" for temp, _ in groups], span, LETTER_WIDTH)
    columns = []
    for k, (temp, indices) in enumerate(groups):
        x0 = LEFT + k * span
        step = (span - room) / len(indices)
        ordered = sorted(indices, key=lambda i: position_order(before[i].dwell.position))
        numbers = [before[i].dwell.position.lstrip("TCP") for i in ordered]
        labels = with_room(numbers, step, LETTER_WIDTH)
        columns.append(
            {
                "x": round(x0, 2),
                "middle": round(x0 + span / 2, 2),
                "end": round(x0 + span, 2),
                "title": titles[k],
                "limit": axis.y(limits.at(temp, delivery.unit.t0_degc)[0]),
                "marks": [
                    {
                        "x": round(x0 + room / 2.0 + step * (n + 0.5), 2),
                        "before": axis.y(before[i].error_g),
                        "after": axis.y(delivery.chosen.residuals[i].error_g),
                        "label": labels[n],
                        "words": _words(before[i], delivery.chosen.residuals[i], t),
                    }
                    for n, i in enumerate(ordered)
                ],
            }
        )
    return {
        "radius": 2.8 if step > _CLOSE else 1.6,
        "height": HEAD + PLOT + FOOT,
        "bottom": HEAD + PLOT,
        "columns": columns,
        "ticks": [
            {"y": axis.y(10.0 ** (e - 3)), "label": _label(e)}
            for e in range(axis.low, axis.high + 1)
        ],
    }


def _words(before: Residual, after: Residual, t: Speaker) -> str:
    """The values of one dwell."""
    return t(
        "residuals.mark",
        position=before.dwell.position,
        temp=signed(f"{before.dwell.temp_degc:.4g}"),
        before=g_in_words(abs(before.error_g)),
        after=g_in_words(abs(after.error_g)),
    )


def _label(exponent: int) -> str:
    """10^exponent mg in a short unit."""
    if exponent >= 0:
        return f"{10**exponent} mg"
    return f"{10 ** (exponent + 3)} µg" if exponent >= -3 else f"{10 ** (exponent + 6)} ng"
