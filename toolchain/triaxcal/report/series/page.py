"""series.html and series.json: yield, distributions, outliers, drift."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
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
    outlier_factor,
    outliers,
    quantities,
    runs,
)
from triaxcal.codegen.templates import environment
from triaxcal.delivery.verdict import PASSED
from triaxcal.report.pictures.series import BASE, HEIGHT, WIDTH, drift, histogram
from triaxcal.report.series.results import results

PAGE_FILE, JSON_FILE = "series.html", "series.json"
FORMAT = 1
MOST_ROWS = 30
"""Of a table on the page; series.json has all."""


def series_files(series: Series) -> dict[str, bytes]:
    """The page, and the same as JSON; no clock in them."""
    records = series.records
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
        "models": Counter(r["thermal_model"] for r in records).most_common(),
        "sources": Counter(r["worst_source"] for r in records).most_common(),
        "acceptance": [_acceptance(records, w) for w in ("at T0", "over the range") if records],
        "t0": ", ".join(sorted({f"{r['t0_degc']:g}" for r in records})),
        "width": WIDTH,
        "height": HEIGHT,
        "base": BASE,
        "groups": [
            {
                "unit": group[0]["reading_unit"],
                "units": len(group),
                "histograms": [histogram(q, group, far) for q in found],
            }
            for group, found in groups
        ],
        "outliers": [
            {**asdict(o), "value": f"{o.value:.6g}", "spreads": _spreads(o)}
            for o in far[:MOST_ROWS]
        ],
        "more_outliers": max(0, len(far) - MOST_ROWS),
        "factor": f"{outlier_factor(len(groups[0][0]), 36):.2f}" if records else "",
        "enough": bool(groups) and len(groups[0][0]) >= FEWEST_UNITS,
        "fewest": FEWEST_UNITS,
        "runs": [_run(r) for r in by_run[:60]],
        "more_runs": max(0, len(by_run) - 60),
        "drift": drift(by_run),
    }
    page = environment().get_template("pages/series.html.j2").render(context)
    return {PAGE_FILE: page.encode(), JSON_FILE: _json(series, groups, far, by_run)}


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
    return f"{outlier.spreads:.1f}" if math.isfinite(outlier.spreads) else "all others agree"


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
        "median": f"{100 * float(np.median(shares)):.2g} %",
        "most": f"{100 * max(shares):.2g} %",
        "end": f"{100 * max(ends):.2g} %",
    }


def _run(r: Run) -> dict[str, Any]:
    return {
        "rig": r.rig,
        "date": r.date,
        "units": r.units,
        "pattern": f"{r.pattern_arcsec:.2g}",
        "worst": r.worst or "nothing to compare with",
        "shift": f"{r.shift:+.3g} {r.of_unit}" if r.worst else "",
        "z": f"{r.z:.1f}" if r.worst else "",
        "far": r.told,
    }
