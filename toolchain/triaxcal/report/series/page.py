"""series.html and series.json: yield, distributions, outliers, drift."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from triaxcal import __version__
from triaxcal.base.jsontext import json_bytes
from triaxcal.batch.run import Series
from triaxcal.batch.statistics import (
    FEWEST_UNITS,
    Outlier,
    Quantity,
    Run,
    alike,
    imus,
    outlier_factor,
    outliers,
    quantities,
    runs,
    triads,
)
from triaxcal.delivery.verdict import PASSED
from triaxcal.report.pictures.series import (
    BASE,
    HEIGHT,
    LEFT,
    RIGHT,
    WIDTH,
    drift,
    error_histogram,
    histogram,
)
from triaxcal.report.series.results import results
from triaxcal.report.series.units import rows_of, units_csv
from triaxcal.report.texts.html import page
from triaxcal.report.words.numbers import scaled, significant

PAGE_FILE, JSON_FILE = "series.html", "series.json"
FORMAT = 1
MOST_ROWS = 30
"""Of a table on the page; series.json has all."""
_WHERES = ("at T0", "over the range")


def series_files(series: Series, build: Path | None = None) -> dict[str, bytes]:
    """The page, and the same as JSON; no clock in them.

    `build` is the folder that receives them, where it has pages of units that the series skips.
    """
    records = series.records
    rows = rows_of(series, build)
    accelerometers = triads(records)
    groups = [(group, quantities(group)) for group in alike(records)]
    far = [o for group, found in groups for o in outliers(group, found)]
    by_run = [r for group, _ in groups for r in runs(group)]
    verdicts = results(series)
    context = {
        "version": __version__,
        "total": len(records) + len(series.refused),
        "made": len(records),
        "passed": dict(verdicts)[PASSED],
        "verdicts": [{"result": result, "units": count} for result, count in verdicts if count],
        "others": [
            {"unit": r["unit"], "words": r["verdict"]} for r in records if r["result"] != PASSED
        ][:MOST_ROWS],
        "more_others": max(0, sum(r["result"] != PASSED for r in records) - MOST_ROWS),
        "refusals": [
            {"unit": name, "why": why} for name, why in sorted(series.refused.items())[:MOST_ROWS]
        ],
        "more_refusals": max(0, len(series.refused) - MOST_ROWS),
        "yield": _percent(dict(verdicts)[PASSED], len(records) + len(series.refused)),
        "models": Counter(r["thermal_model"] for r in accelerometers).most_common(),
        "sources": Counter(
            r["worst_source"] for r in accelerometers if r["worst_source"]
        ).most_common(),
        "kinds": _kinds(records),
        "triads": len(accelerometers),
        "acceptance": [_acceptance(accelerometers, w) for w in _WHERES if accelerometers],
        "t0": ", ".join(sorted({f"{r['t0_degc']:g}" for r in accelerometers})),
        "width": WIDTH,
        "height": HEIGHT,
        "base": BASE,
        "groups": [
            _group(group, [histogram(q, group, far, _factor(group, found)) for q in found])
            for group, found in groups
        ],
        "outliers": [
            {**asdict(o), "value": scaled(o.value, abs(o.value), 6), "spreads": _spreads(o)}
            for o in far[:MOST_ROWS]
        ],
        "more_outliers": max(0, len(far) - MOST_ROWS),
        "factor": _factor_words(groups),
        "enough": bool(groups) and len(groups[0][0]) >= FEWEST_UNITS,
        "fewest": FEWEST_UNITS,
        "runs": [_run(r) for r in by_run[:60]],
        "more_runs": max(0, len(by_run) - 60),
        "drift": drift(by_run),
        "left": LEFT,
        "right": WIDTH - RIGHT,
        "errors": _error_histograms(accelerometers),
        "rows": rows,
        "skipped": len(series.skipped),
        "csv": units_csv(rows),
    }
    return {
        PAGE_FILE: page("series.html.j2", **context),
        JSON_FILE: _json(series, groups, far, by_run),
    }


def _json(
    series: Series,
    groups: Sequence[tuple[list[dict[str, Any]], list[Quantity]]],
    far: Sequence[Outlier],
    by_run: Sequence[Run],
) -> bytes:
    document = {
        "format": FORMAT,
        "triaxcal": __version__,
        "units": len(series.records) + len(series.refused),
        "made": len(series.records),
        "passed": dict(results(series))[PASSED],
        "verdicts": dict(results(series)),
        "refused": dict(sorted(series.refused.items())),
        "skipped": dict(sorted(series.skipped.items())),
        "distributions": [
            {
                "quantity": q.name,
                "units": len(group),
                "unit": q.unit,
                "median": q.median,
                "spread": q.spread,
                "mean": float(q.values.mean()),
                "sd": float(q.values.std(ddof=1)) if len(q.values) > 1 else None,
                "min": float(q.values.min()),
                "max": float(q.values.max()),
            }
            for group, found in groups
            for q in found
        ],
        "outliers": [
            asdict(o) | {"spreads": o.spreads if math.isfinite(o.spreads) else None} for o in far
        ],
        "runs": [asdict(r) for r in by_run],
        "records": series.records,
    }
    return json_bytes(document)


def _percent(part: int, whole: int) -> str:
    return f"{100 * part / whole:.1f} %" if whole else "-"


def _spreads(outlier: Outlier) -> str:
    if not math.isfinite(outlier.spreads):
        return "all others agree"
    return scaled(outlier.spreads, max(outlier.spreads, 10.0), 3)


def _factor(group: Sequence[dict[str, Any]], found: Sequence[Quantity]) -> float | None:
    """Spreads beyond which a unit is far from the others; None of too few units."""
    return outlier_factor(len(group), len(found)) if len(group) >= FEWEST_UNITS else None


def _factor_words(groups: Sequence[tuple[list[dict[str, Any]], list[Quantity]]]) -> str:
    """That of the largest group; empty where it has too few units."""
    factor = _factor(*groups[0]) if groups else None
    return "" if factor is None else f"{factor:.2f}"


def _kinds(records: Sequence[dict[str, Any]]) -> str:
    """What the series is of, in words."""
    names = {"triaxial accelerometers": triads(records), "IMUs": imus(records)}
    return " and ".join([name for name, found in names.items() if found] or names)


def _group(group: Sequence[dict[str, Any]], pictures: list[dict[str, Any]]) -> dict[str, Any]:
    """Histograms of units that can be compared: of an IMU block by block, with the units' sd."""
    found: dict[str, Any] = {"units": len(group), "unit": group[0].get("reading_unit", "")}
    if not imus(group):
        return found | {"parts": [{"title": "", "histograms": pictures}], "imus": ""}
    parts: dict[str, list[dict[str, Any]]] = {}
    for k, (state, picture) in enumerate(zip(group[0]["states"], pictures, strict=True)):
        sd = float(np.median([r["states"][k]["sd"] for r in group]))
        picture["sd"] = f"{significant(sd)} {picture['unit']}"
        parts.setdefault(state["block"], []).append(picture)
    blocks = ", ".join(group[0]["blocks"]) or "none"
    titled = [{"title": t[0].upper() + t[1:], "histograms": h} for t, h in parts.items()]
    return found | {"parts": titled, "imus": f"extensions: {blocks}"}


def _error_histograms(records: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Largest errors at T0 and over the range, of units with one limit: of the most of them."""
    found = []
    for where in _WHERES:
        by_limit: dict[float, list[float]] = defaultdict(list)
        for record in records:
            for a in record["acceptance"]:
                if a["where"] == where:
                    by_limit[a["limit_g"]].append(1e3 * a["largest_residual_g"])
        for limit_g, errors in sorted(by_limit.items(), key=lambda item: -len(item[1]))[:2]:
            name = f"{where}, {len(errors)} unit{'s' * (len(errors) > 1)}"
            found.append(error_histogram(np.array(errors), 1e3 * limit_g, name))
    return found


def _share(share: float) -> str:
    """Share of a limit in percent, three digits."""
    return f"{scaled(100.0 * share, max(abs(100.0 * share), 1.0), 3)} %"


def _acceptance(records: Sequence[dict[str, Any]], where: str) -> dict[str, str]:
    """Largest residuals of the units against the limit, as share of it."""
    shares = [
        a["largest_residual_g"] / a["limit_g"]
        for r in records
        for a in r["acceptance"]
        if a["where"] == where
    ]
    ends = [
        (a["largest_residual_g"] + a["expanded_uncertainty_g"]) / a["limit_g"]
        for r in records
        for a in r["acceptance"]
        if a["where"] == where
    ]
    if not shares:
        return {"where": where, "units": "0", "median": "-", "most": "-", "end": "-"}
    return {
        "where": where,
        "units": str(len(shares)),
        "median": _share(float(np.median(shares))),
        "most": _share(max(shares)),
        "end": _share(max(ends)),
    }


def _run(r: Run) -> dict[str, Any]:
    return {
        "rig": r.rig,
        "date": r.date,
        "units": r.units,
        "pattern": significant(r.pattern_arcsec),
        "worst": r.worst or "nothing to compare with",
        "shift": f"{scaled(r.shift, abs(r.shift), 3)} {r.of_unit}" if r.worst else "",
        "z": scaled(r.z, max(r.z, 10.0), 3) if r.worst else "",
        "far": r.told,
    }
