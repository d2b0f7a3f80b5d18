"""report.html: the test report as one page, for paper and for a phone."""

from __future__ import annotations

import re
from itertools import groupby
from typing import Any

from markupsafe import Markup, escape

from triaxcal import __version__
from triaxcal.performance.figures import Chapter, Drawing, Figure
from triaxcal.performance.testreport import STANDARDS, UnitReport
from triaxcal.report.pictures.line_plot import COLOURS, Line, Panel, line_plot
from triaxcal.report.testreport.words import NOT_MEASURED, on_page, value_words
from triaxcal.report.texts.html import page


def report_html(report: UnitReport) -> bytes:
    """HTML of a report: no network, no clock, no script."""
    figures = report.figures
    measured = sum(f.measured for f in figures)
    context = {
        "identity": _identity(report),
        "name": report.fitted.unit.name,
        "standard": STANDARDS[report.standard],
        "measured": measured,
        "total": len(figures),
        "verdict": report.verdict,
        "chapters": [_chapter(chapter) for chapter in report.chapters],
        "files": sorted(report.files.items()),
        "version": __version__,
    }
    return page("testreport.html.j2", **context)


def _identity(report: UnitReport) -> list[tuple[str, str]]:
    unit, calibration = report.fitted.unit, report.fitted.calibration
    low, high = calibration.range_degc
    rows = [
        ("Unit", unit.name),
        ("Serial number", unit.serial),
        ("Measured", unit.measured.run or "not stated"),
        ("Working range", on_page(f"{low:.4g} to {high:.4g} degC")),
        ("T0", on_page(f"{unit.t0_degc:g} degC")),
        ("Input range", on_page(f"-{unit.reporting.input_range_g:g} to "
                                f"{unit.reporting.input_range_g:g} g")),
        ("Verdict", report.verdict.words),
        ("Inputs, SHA-256", report.fitted.inputs_sha256[:16]),
    ]  # fmt: skip
    if calibration.inputs:
        rows.append(("Columns", ", ".join(calibration.inputs)))
    return rows


def _chapter(chapter: Chapter) -> dict[str, Any]:
    return {
        "key": chapter.key,
        "title": chapter.title,
        "definition": _with_indices(on_page(chapter.definition)),
        "groups": _groups(chapter.figures),
        "notes": [on_page(note) for note in chapter.notes],
        "drawings": [
            {"title": on_page(d.title), "svg": Markup(drawing_svg(d).decode())}
            for d in chapter.drawings
        ],
    }


def _with_indices(text: str) -> Markup:
    """HTML of a text in which K1_i and K_jk have lower indices."""
    shown = str(escape(text)).replace("sum_", "\u03a3_")
    return Markup(re.sub(r"\b(\w+?)_([a-z]{1,2})(?![A-Za-z0-9])", r"\1<sub>\2</sub>", shown))


def _groups(figures: tuple[Figure, ...]) -> list[dict[str, Any]]:
    """Rows of one name together: the name stands once, and so does how all were measured."""
    groups = []
    for (name, unit), members in groupby(figures, key=lambda f: (f.name, f.unit)):
        rows = [
            {
                "axis": f.axis,
                "value": on_page(value_words(f)),
                "measured": f.measured,
                "how": on_page(f.how if f.measured else f"{NOT_MEASURED}: {f.why}"),
            }
            for f in members
        ]
        same = len({row["how"] for row in rows}) == 1
        for k, row in enumerate(rows):
            row["span"] = len(rows) if same else 1
            row["first"] = not (same and k)
        groups.append({"name": on_page(name), "unit": on_page(unit), "rows": rows})
    return groups


def drawing_svg(drawing: Drawing) -> bytes:
    """Picture of curves over a common axis."""
    lines = [
        Line(c.label, COLOURS[c.axis % len(COLOURS)], c.x, c.y, c.dashed) for c in drawing.curves
    ]
    title = on_page(drawing.title)
    panel = Panel("", on_page(drawing.x_label), lines, powers=drawing.powers)
    return line_plot(title, [panel])
