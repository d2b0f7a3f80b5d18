"""report.json: the test report for machines. docs/reference/file-formats.md has the layout."""

from __future__ import annotations

from typing import Any

from triaxcal import __version__
from triaxcal.base.jsontext import json_bytes
from triaxcal.performance.figures import Chapter, Drawing, Figure
from triaxcal.performance.testreport import UnitReport
from triaxcal.uncertainty.coverage import LEVEL

FORMAT = 1


def report_json(report: UnitReport) -> bytes:
    """JSON of a test report; without a clock, so equal inputs give equal bytes."""
    unit = report.fitted.unit
    document = {
        "format": FORMAT,
        "triaxcal": __version__,
        "standard": report.standard,
        "unit": unit.name,
        "serial": unit.serial,
        "inputs_sha256": report.fitted.inputs_sha256,
        "recordings_sha256": report.files,
        "coverage_probability": LEVEL,
        "verdict": report.verdict.words,
        "chapters": [_chapter(chapter) for chapter in report.chapters],
    }
    return json_bytes(document)


def _chapter(chapter: Chapter) -> dict[str, Any]:
    return {
        "key": chapter.key,
        "title": chapter.title,
        "definition": chapter.definition,
        "notes": list(chapter.notes),
        "figures": [figure_json(figure) for figure in chapter.figures],
        "curves": [curve for drawing in chapter.drawings for curve in _curves(drawing)],
    }


def figure_json(figure: Figure) -> dict[str, Any]:
    """One figure; null where there is no number."""
    return {
        "key": figure.key,
        "name": figure.name,
        "axis": figure.axis,
        "unit": figure.unit,
        "measured": figure.measured,
        "value": figure.value,
        "low": figure.low,
        "high": figure.high,
        "expanded_uncertainty": figure.expanded,
        "how": figure.how,
        "not_measured_because": figure.why,
    }


def _curves(drawing: Drawing) -> list[dict[str, Any]]:
    return [
        {
            "drawing": drawing.title,
            "label": curve.label,
            "x_label": drawing.x_label,
            "x": curve.x.tolist(),
            "y": curve.y.tolist(),
        }
        for curve in drawing.curves
    ]
