"""Pictures of a series: histograms of the constants and errors, and a rig's pattern run by run."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from triaxcal.batch.statistics import Outlier, Quantity, Run
from triaxcal.model.types import BoolArray, FloatArray
from triaxcal.report.pictures.curves import ticks
from triaxcal.report.words.numbers import scaled, signed, significant, superscript

WIDTH, HEIGHT = 252.0, 138.0
LEFT, RIGHT, TOP, BASE = 34.0, 18.0, 14.0, 104.0
_SMALL_MG = 0.05
"""The end of an axis below which it is in micro-g."""
_LONG = 4
"""Characters of a label beyond which fewer of them have room."""
RUN_WIDTH, RUN_HEIGHT = 700.0, 190.0


@dataclass(frozen=True)
class Limit:
    """A line of a histogram: a value that is not to be exceeded, and what it is."""

    value: float
    label: str


def histogram(
    q: Quantity,
    records: Sequence[dict[str, Any]],
    far: Sequence[Outlier],
    factor: float | None = None,
) -> dict[str, Any]:
    """Of a constant: units far from the others in red; dashed is where far begins.

    `factor` is that distance in spreads; None where nothing is searched for.
    """
    red = {o.unit for o in far if o.quantity == q.name}
    is_far = np.array([r["unit"] in red for r in records])
    limits = []
    if factor is not None and q.spread > 0.0:
        words = f"{factor:.1f} spreads from the median"
        limits = [Limit(q.median + side * factor * q.spread, words) for side in (-1.0, 1.0)]
    low, high = _ends(q.values)
    return {
        "name": q.name,
        "median": _rounded(q.median, q.spread),
        "spread": _rounded(q.spread, q.spread),
        **_drawn(q.values, is_far, (low, high), q.unit, limits),
    }


def error_histogram(errors_mg: FloatArray, limit_mg: float, name: str) -> dict[str, Any]:
    """Of the largest errors of the units against a limit that they have in common, in mg."""
    top = max(float(errors_mg.max()), limit_mg)
    if limit_mg > 4.0 * errors_mg.max():  # else all of the units would be one bar
        top = float(errors_mg.max()) or limit_mg
    beyond = limit_mg > 1.05 * top
    unit, scale = ("µg", 1e3) if top < _SMALL_MG else ("mg", 1.0)
    limit = Limit(limit_mg * scale, f"limit {significant(limit_mg, 3)} mg")
    errors = errors_mg * scale
    picture = _drawn(errors, errors_mg > limit_mg, (0.0, 1.05 * top * scale), unit, [limit])
    return {"name": name, "beyond": limit.label if beyond else "", **picture}


def _ends(values: FloatArray) -> tuple[float, float]:
    low, high = float(values.min()), float(values.max())
    if high == low:
        pad = abs(low) * 1e-3 or 1.0
        return low - pad, high + pad
    return low, high


def _drawn(
    values: FloatArray,
    marked: BoolArray,
    ends: tuple[float, float],
    unit: str,
    limits: Sequence[Limit],
) -> dict[str, Any]:
    low, high = ends
    span = high - low
    bins = max(5, min(29, round(2 * len(values) ** (1 / 3)) * 2 - 1))
    edges = np.linspace(low, high, bins + 1)
    near = np.histogram(values[~marked], edges)[0].tolist()
    away = np.histogram(values[marked], edges)[0].tolist()
    top = max(1, *(a + b for a, b in zip(near, away, strict=True)))
    marks, exponent = _scale(ticks(low, high, 5))
    if any(len(label) > _LONG for _, label in marks):
        marks, exponent = _scale(ticks(low, high, 3))

    def x(value: float) -> float:
        return round(float(LEFT + (WIDTH - LEFT - RIGHT) * (value - low) / span), 2)

    def y(count: float) -> float:
        return round(float(BASE - (BASE - TOP) * count / top), 2)

    def bar(k: int, below: int, count: int, kind: str) -> dict[str, Any]:
        said = f"{count} unit{'s' if count > 1 else ''}, {scaled(edges[k], span)} to "
        said += f"{scaled(edges[k + 1], span)} {unit}"
        return {
            "x": round(x(edges[k]) + 0.4, 2),
            "width": round(max(x(edges[k + 1]) - x(edges[k]) - 0.8, 0.8), 2),
            "y": y(below + count),
            "height": round(y(below) - y(below + count), 2),
            "kind": kind,
            "title": said,
        }

    stacks = [(k, b, c, "near") for k, b, c in zip(range(bins), [0] * bins, near, strict=True)]
    stacks += [(k, b, c, "far") for k, b, c in zip(range(bins), near, away, strict=True)]
    places = [(x(value), label) for value, label in marks]
    lines = [limit for limit in limits if low <= limit.value <= high]
    return {
        "unit": unit,
        "axis_unit": f"10{superscript(exponent)} {unit}" if exponent else unit,
        "bars": [bar(*stack) for stack in stacks if stack[2]],
        "labels": [{"x": at, "label": w} for at, w in places if LEFT <= at <= WIDTH - RIGHT],
        "counts": [{"y": y(n), "label": f"{n}"} for n in _counts(top)],
        "limits": [
            {"x": x(line.value), "title": f"{line.label}: {scaled(line.value, span)} {unit}"}
            for line in lines
        ],
    }


def _counts(top: int) -> list[int]:
    """Whole numbers of the axis of counts, 0 and the top among them."""
    between = [round(t) for t in ticks(0.0, float(top), 2) if 0.2 * top < t < 0.8 * top]
    return sorted({0, top, *between})


def _scale(values: Sequence[float]) -> tuple[list[tuple[float, str]], int]:
    """Values with their labels, all with as many decimals, and the power of ten taken out."""
    largest = max((abs(v) for v in values), default=0.0)
    exponent = 0
    if largest and not 1e-3 <= largest < 1e5:
        exponent = 3 * math.floor(math.log10(largest) / 3)
    shown = [v / 10.0**exponent for v in values]
    places = max((len(f"{v:.6f}".rstrip("0").partition(".")[2]) for v in shown), default=0)
    labels = [signed(f"{v + 0.0:.{places}f}") for v in shown]
    return list(zip(values, labels, strict=True)), exponent


def _rounded(value: float, spread: float) -> str:
    """Value to the second digit of its spread."""
    return scaled(value, spread, 2) if spread > 0.0 else scaled(value, abs(value), 6)


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
                    {"y": round(150 - 136 * t / (top * 1.1), 2), "label": label}
                    for t, label in _scale(scale)[0]
                ],
                "marks": [
                    {
                        "x": round(56 + step * (k + 0.5), 2),
                        "y": round(150 - 136 * r.pattern_arcsec / (top * 1.1), 2),
                        "far": r.told,
                        "title": f"{r.date}, {r.units} units: "
                        f"{significant(r.pattern_arcsec)} arcsec",
                    }
                    for k, r in enumerate(its)
                ],
                "first": its[0].date,
                "last": its[-1].date,
            }
        )
    return pictures
