"""What `triaxcal report` and `triaxcal noise` print."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from triaxcal.base.screentext import table
from triaxcal.performance.figures import Chapter, Figure
from triaxcal.performance.testreport import UnitReport
from triaxcal.report.testreport.words import NOT_MEASURED, value_words


def report_text(report: UnitReport) -> str:
    """Chapters with their figures; what is not measured in one line each."""
    figures = report.figures
    measured = sum(f.measured for f in figures)
    unit = report.fitted.unit
    head = [
        f"unit      {unit.name}  (serial {unit.serial})",
        f"verdict   {report.verdict.words}",
        f"standard  {report.standard}; {measured} of {len(figures)} figures measured; 95 %",
    ]
    return "\n\n".join(["\n".join(head), *(_chapter(c) for c in report.chapters)])


def _chapter(chapter: Chapter) -> str:
    lines = figure_lines(chapter.title.lower(), chapter.figures)
    lines += [f"  {note}" for note in chapter.notes]
    return "\n".join(lines)


def figure_lines(title: str, figures: Sequence[Figure]) -> list[str]:
    """A table of the figures, then why others were not measured."""
    rows: list[list[str]] = []
    last = ""
    for f in figures:
        if f.measured:
            rows.append(["" if f.name == last else f"  {f.name}", f.axis, value_words(f), f.unit])
            last = f.name
    lines = table([title, "", "value", "unit"], rows, left=(0, 1, 3)) if rows else [title]
    lacking = [f for f in figures if not f.measured]
    for why, members in groupby(sorted(lacking, key=lambda f: f.why), key=lambda f: f.why):
        names = list(dict.fromkeys(f.name for f in members))
        lines.append(f"  {', '.join(names)}: {NOT_MEASURED}: {why}")
    return lines
