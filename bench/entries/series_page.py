"""The page of a series: the list of its units, statistics and histograms."""

from __future__ import annotations

import sys
import time

from measuring import TESTS, Bench, Figure, pick

sys.path.insert(0, str(TESTS))

from test_series_statistics import drawn, series_of
from triaxcal.report.series.page import series_files


def measure(size: str) -> list[Figure]:
    found = []
    for count in pick(size, (40,), (40, 1000), (40, 1000, 10_000)):
        series = series_of(drawn(count, 4), {})
        series_files(series)
        start = time.process_time()
        files = series_files(series)
        seconds = time.process_time() - start
        found.append((count, seconds, len(files["series.html"]) / 1e3))
    (few, least, _), (most, longest, size_kb) = found[0], found[-1]
    return [
        Figure(f"the page of {most} units", longest, "CPU s", f"that of {few} units", least),
        Figure("its size", size_kb, "kB", f"that of {few} units", found[0][2]),
    ]


ENTRY = Bench(
    name="series_page",
    label="The page of a series",
    doc="series.html and series.json, from the records of the units.",
    measure=measure,
    figures=("the page of 1000 units", "its size"),
    sizes="1000 units, 10 000 with --full",
    rank=22,
)
