"""docs/performance.md, and the same for the terminal: formed from the registry of benchmarks."""

from __future__ import annotations

import platform
from collections.abc import Mapping

from measuring import BENCHES, KINDS, ROOT, Bench, Figure

from triaxcal.batch.local import cores
from triaxcal.report.words.numbers import scaled, thousands

PAGE = ROOT / "docs" / "performance.md"
_HEAD = """\
# Performance

<!-- written by `make bench`; do not edit -->

Every figure on this page is of one run of `make bench`, on {cores} with Python {python}{how}.
What is compared was measured in turn in that run. *Ratio*: above 1, the other takes more. It is
{ratios}.
Times are processor time of all processes, unless a row says otherwise. On another machine the
seconds differ, and the ratios change little.

    make bench                                            # all of them, and this page
    .venv/bin/python bench/run.py series --full

`--full` measures longer. A benchmark is one file in `bench/entries`; a file that is dropped in is
found.
"""
_CITED = """
## Cited, not measured

CMSIS-DSP has no calibration that could be measured here. What its documentation says of its
arithmetic stands in [other tools](comparison.md#cmsis-dsp). The instructions that a call takes on
each core, and the least that is possible there, are in
[the C on microcontrollers](reference/targets.md#what-a-call-costs).
"""


def number(value: float) -> str:
    """Three digits, without an exponent."""
    return scaled(value, abs(value), 3) if abs(value) < 100.0 else thousands(round(value))


def row(figure: Figure) -> tuple[str, str, str, str, str]:
    """Cells of a figure's row."""
    ratio = "" if figure.ratio is None else number(figure.ratio)
    other = f"{number(figure.other)} {figure.unit}" if figure.against else ""
    return figure.what, f"{number(figure.value)} {figure.unit}", figure.against, other, ratio


def section(bench: Bench, figures: list[Figure] | str) -> str:
    """A benchmark's part of the page."""
    lines = [f"## {bench.label}", "", bench.doc, ""]
    if isinstance(figures, str):
        return "\n".join([*lines, f"*Not measured in this run*: {figures}.", ""])
    lines += ["| what | figure | beside | figure | ratio |", "|---|---|---|---|---|"]
    lines += [f"| {' | '.join(row(figure))} |" for figure in figures]
    size = f" {bench.sizes[0].upper()}{bench.sizes[1:]}." if bench.sizes else ""
    return "\n".join([*lines, "", f"`bench/entries/{bench.name}.py`.{size}", ""])


def page(found: Mapping[str, list[Figure] | str], size: str, load: float = 0.0) -> str:
    """The page of a run of all benchmarks; `load` is that of the machine before and after."""
    count = cores()
    how = ", at full length" if size == "full" else ""
    if load > count:
        how += (
            f". Other work took most of the machine: its load was {load:.0f}, which makes seconds"
            " longer and leaves ratios nearly as they are"
        )
    head = _HEAD.format(
        cores=f"{count} core{'s' * (count != 1)}",
        python=".".join(platform.python_version_tuple()[:2]),
        how=how,
        ratios=";\n".join(kind.words for kind in KINDS.values()),
    )
    return "\n".join([head, *(section(b, found[b.name]) for b in BENCHES)]) + _CITED


def printed(bench: Bench, figures: list[Figure] | str, seconds: float) -> str:
    """The same for a terminal."""
    head = f"{bench.label}  ({bench.name}, {seconds:.0f} s of processor time)"
    if isinstance(figures, str):
        return f"{head}\n  not measured: {figures}"
    lines = []
    for what, value, against, other, ratio in map(row, figures):
        beside = f"   {against}: {other}, ratio {ratio}" if against else ""
        lines.append(f"  {what:<60} {value:>18}{beside}")
    return "\n".join([head, *lines])
