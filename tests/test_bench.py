"""Benchmarks: a registry, a page that is formed from it, and that each of them runs."""

from __future__ import annotations

import math
import re
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

REPO = Path(__file__).parent.parent
sys.path.insert(0, str(REPO / "bench"))

pytest.importorskip("can", reason="benchmarks of the bench need python-can")

from measuring import BENCHES, KINDS, Bench, Figure  # noqa: E402
from performance_page import PAGE, page, printed, row, section  # noqa: E402

BOUND = re.compile(
    r"\d[\d.]* ?(?:ms|s|µs|us|minutes?|seconds?) of (?:CPU|processor time|gcc)|\bCPU s\b"
    r"|\d units a minute|µs a frame|us a frame|times as (?:fast|slow)\b"
)
"""Words of a figure of speed."""


def a_bench(figures: list[Figure]) -> Bench:
    return Bench("toy", "A toy", "What it is.", lambda _size: figures, ("what it does",))


def slug(heading: str) -> str:
    """Anchor of a heading, as GitHub and the site make it."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-")


def test_every_file_is_a_benchmark_by_its_name() -> None:
    files = {p.stem for p in (REPO / "bench/entries").glob("*.py") if p.stem[0] != "_"}
    assert files == set(BENCHES.names)


def test_the_page_has_what_the_registry_has() -> None:
    """An entry of one's own is on it, with its figures, beside those that are there."""
    figures = [Figure("what it does", 0.25, "s", "another", 1.0), Figure("alone", 3.0, "MB")]
    with BENCHES.added(a_bench(figures)):
        found: dict[str, list[Figure] | str] = dict.fromkeys(BENCHES.names, "left out")
        text = page({**found, "toy": figures}, "short")
    assert "## A toy\n\nWhat it is.\n" in text
    assert "| what it does | 0.250 s | another | 1.00 s | 4.00 |" in text
    assert "| alone | 3.00 MB |  |  |  |" in text
    for kind in KINDS.values():
        assert kind.words in text
    assert text.count("*Not measured in this run*: left out.") == len(BENCHES.names)
    for bench in BENCHES:
        assert f"\n## {bench.label}\n" in text
    assert "## A toy" not in page(found, "short")


def test_above_1_the_other_takes_more_of_a_rate_too() -> None:
    """Half as many a minute is twice the time."""
    assert Figure("", 0.5, "s", "another", 1.0).ratio == 2.0
    assert Figure("", 100.0, "a minute", "another", 50.0, "rate").ratio == 2.0
    assert Figure("", 1.0, "s", "another", 0.0).ratio is None
    named = {figure.kind for figure in (Figure("", 1.0, "s"), Figure("", 1.0, "", kind="rate"))}
    assert named == set(KINDS)


def test_a_busy_machine_is_said() -> None:
    found: dict[str, list[Figure] | str] = dict.fromkeys(BENCHES.names, "left out")
    assert "Other work" not in page(found, "short", 0.1)
    assert "its load was 99" in page(found, "short", 99.0)


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0012345, "0.00123 s"), (12.345, "12.3 s"), (21286.4, "21\u202f286 s"), (0.0, "0 s")],
)
def test_numbers_have_no_exponent(value: float, text: str) -> None:
    assert row(Figure("x", value, "s"))[1] == text


def test_a_benchmark_that_fails_is_said() -> None:
    bench = a_bench([])
    assert "*Not measured in this run*: no qemu." in section(bench, "no qemu")
    assert "not measured: no qemu" in printed(bench, "no qemu", 1.0)


@pytest.mark.parametrize("bench", list(BENCHES), ids=lambda b: b.name)
def test_the_page_of_the_documentation_has_every_figure(bench: Bench) -> None:
    text = PAGE.read_text(encoding="utf-8")
    part = text.partition(f"\n## {bench.label}\n")[2].partition("\n## ")[0]
    assert bench.doc in part, "run `make bench`, and commit the page"
    rows = [line.split(" | ")[0].removeprefix("| ") for line in part.splitlines() if "|" in line]
    assert [what for what in bench.figures if what not in rows] == []


def test_pages_name_sections_of_the_page_that_exist() -> None:
    text = PAGE.read_text(encoding="utf-8")
    sections = {slug(heading) for heading in re.findall(r"^## (.+)$", text, re.MULTILINE)}
    texts = [p.read_text(encoding="utf-8") for p in (REPO / "docs").rglob("*.md")]
    named = {a for t in texts for a in re.findall(r"performance\.md#([\w-]+)", t)}
    assert len(named) >= 6
    assert named <= sections


def test_figures_of_speed_stand_on_that_page_alone() -> None:
    """What a page says of speed ages: it links instead."""
    pages = [*(REPO / "docs").rglob("*.md"), REPO / "README.md"]
    found = {
        f"{p.relative_to(REPO)}: {match[0]}"
        for p in pages
        if p != PAGE and "_build" not in p.parts
        for match in BOUND.finditer(p.read_text(encoding="utf-8"))
    }
    assert found == set()


@pytest.mark.long
@pytest.mark.parametrize("bench", list(BENCHES), ids=lambda b: b.name)
def test_each_runs(bench: Bench) -> None:
    missing = [name for name in bench.packages if not find_spec(name)]
    if missing:
        pytest.skip(f"{', '.join(missing)} is not installed")
    if bench.name == "targets" and not _has_cross_tools():
        pytest.skip("no QEMU or cross compiler")
    figures = bench.measure("tiny")
    assert figures
    for figure in figures:
        assert figure.what
        assert math.isfinite(figure.value)
        assert figure.value >= 0.0
        assert figure.against or not figure.other  # a named amount may be 0: no frame was lost
        assert all(cell.count("|") == 0 for cell in row(figure))


def _has_cross_tools() -> bool:
    from triaxcal.base.tools import missing_tools
    from triaxcal.targets.cores.registry import CORES

    counted = [core for core in CORES if core.counted]
    return not missing_tools(counted[0].tools("gcc"))
