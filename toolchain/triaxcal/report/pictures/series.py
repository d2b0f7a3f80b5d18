"""Pictures of a series: histograms of the constants, and a rig's pattern run by run."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np

from triaxcal.batch.statistics import Outlier, Quantity, Run
from triaxcal.report.pictures.curves import ticks
from triaxcal.report.words.numbers import signed

WIDTH, HEIGHT, BASE = 232.0, 96.0, 74.0
RUN_WIDTH, RUN_HEIGHT = 700.0, 190.0
NEAR, FAR = "#0a5fb4", "#c22"
"""Colours of units, and of those far from the others."""


def histogram(
    q: Quantity, records: Sequence[dict[str, Any]], far: Sequence[Outlier]
) -> dict[str, Any]:
    """Bars of a quantity; units far from the others as red bars."""
    low, high = float(q.values.min()), float(q.values.max())
    if high == low:
        pad = abs(low) * 1e-3 or 1.0
        low, high = low - pad, high + pad
    bins = max(5, min(29, round(2 * len(q.values) ** (1 / 3)) * 2 - 1))
    red = {o.unit for o in far if o.quantity == q.name}
    is_far = np.array([r["unit"] in red for r in records])
    edges = np.linspace(low, high, bins + 1)
    near = np.histogram(q.values[~is_far], edges)[0]
    away = np.histogram(q.values[is_far], edges)[0]
    top = max(1, int((near + away).max()))
    step = (WIDTH - 12.0) / bins
    bars = []
    for k in range(bins):
        for count, colour in ((int(near[k]), NEAR), (int(away[k]), FAR)):
            if count:
                height = max(2.0, (BASE - 6.0) * count / top)
                bars.append(
                    {
                        "x": round(6 + k * step + 0.5, 2),
                        "y": round(BASE - height, 2),
                        "width": round(max(step - 1.0, 1.0), 2),
                        "height": round(height, 2),
                        "colour": colour,
                    }
                )
    labels: list[dict[str, Any]] = [
        {"x": round(6 + (WIDTH - 12) * (t - low) / (high - low), 2), "label": signed(f"{t:.6g}")}
        for t in ticks(low, high, 3)
    ]
    return {
        "name": q.name,
        "unit": q.unit,
        "median": _rounded(q.median, q.spread),
        "spread": _rounded(q.spread, q.spread),
        "bars": bars,
        "labels": [x for x in labels if 22 <= x["x"] <= WIDTH - 22],
    }


def _rounded(value: float, spread: float) -> str:
    """Value to the second digit of its spread."""
    if spread <= 0.0:
        return signed(f"{value:.6g}")
    places = 1 - math.floor(math.log10(spread))
    # The sign of a negative value that is rounded to 0 goes.
    return signed(f"{round(value, places) + 0.0:.{max(0, places)}f}")


def drift(by_run: Sequence[Run]) -> list[dict[str, Any]]:
    """One picture a rig with more than one run: the placement pattern's size, run by run."""
    by_rig: dict[str, list[Run]] = defaultdict(list)
    for run in by_run:
        by_rig[run.rig].append(run)
    pictures = []
    for rig, its in by_rig.items():
        if len(its) < 2:
            continue
        top = max(r.pattern_arcsec for r in its) or 1.0
        scale = ticks(0.0, top * 1.1, 4)
        step = (RUN_WIDTH - 70.0) / len(its)
        pictures.append(
            {
                "rig": rig,
                "width": RUN_WIDTH,
                "height": RUN_HEIGHT,
                "ticks": [
                    {"y": round(150 - 136 * t / (top * 1.1), 2), "label": f"{t:g}"} for t in scale
                ],
                "marks": [
                    {
                        "x": round(56 + step * (k + 0.5), 2),
                        "y": round(150 - 136 * r.pattern_arcsec / (top * 1.1), 2),
                        "far": r.told,
                    }
                    for k, r in enumerate(its)
                ],
                "first": its[0].date,
                "last": its[-1].date,
            }
        )
    return pictures
