"""Outliers, drift and the page of a series, on records drawn from a seed."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from batch_workers import record
from triaxcal.batch.run import Series
from triaxcal.batch.statistics import FEWEST_UNITS, outlier_factor, outliers, quantities, runs
from triaxcal.report.series.page import series_files
from triaxcal.report.series.summary import series_summary


def drawn(count: int, seed: int, per_run: int = 25) -> list[dict[str, Any]]:
    """Units with normal constants, and a tilter whose pattern they all see with some noise."""
    rng = np.random.default_rng(seed)
    pattern = 3e-5 * rng.standard_normal((3, 3))
    records = []
    for k in range(count):
        r: dict[str, Any] = record(f"U-{k:04d}")
        r["at_t0"] = (0.5 + 0.003 * rng.standard_normal(12)).tolist()
        r["temperature_coefficients"] = (1e-6 * rng.standard_normal((12, 2))).tolist()
        r["placement_pattern_g"] = (pattern + 3e-6 * rng.standard_normal((3, 3))).tolist()
        r["rig"], r["date"] = "R-1", f"2026-01-{1 + k // per_run:02d}"
        records.append(r)
    return records


@pytest.mark.parametrize("count", [FEWEST_UNITS, 100, 1000])
def test_outliers_of_a_normal_series_are_rare(count: int) -> None:
    """Stated: in one series of twenty. 60 series: 3 expected, more than 9 once in 2000."""
    values = np.random.default_rng(count).standard_normal((60, 36, count))
    middle = np.median(values, axis=2, keepdims=True)
    spread = 1.4826 * np.median(np.abs(values - middle), axis=2, keepdims=True)
    far = np.abs(values - middle) > outlier_factor(count, 36) * spread
    assert far.any(axis=(1, 2)).sum() <= 9


def test_a_planted_outlier_is_found_and_nothing_else() -> None:
    records = drawn(200, 1)
    records[17]["at_t0"][4] += 0.03
    (found,) = outliers(records, quantities(records))
    assert (found.unit, found.quantity, found.of_unit) == ("U-0017", "Kyy", "mV/g")
    assert 8.0 < found.spreads < 13.0


def test_few_units_say_nothing_of_outliers() -> None:
    records = drawn(FEWEST_UNITS - 1, 1)
    records[0]["at_t0"][0] = 5.0
    assert outliers(records, quantities(records)) == []


def test_a_tilter_that_moved_is_told_at_its_run_alone() -> None:
    records = drawn(200, 2)
    for r in records[125:]:
        # 2 arcsec seen by z on the x pair: 10 micro-g.
        r["placement_pattern_g"][0][2] += 1e-5
    told = [r for r in runs(records) if r.told]
    assert [(r.date, r.worst) for r in told] == [("2026-01-06", "placement, x pair seen by z")]
    assert told[0].shift == pytest.approx(10.0, abs=3.0)
    assert told[0].of_unit == "µg"


def test_a_steady_tilter_is_not_told() -> None:
    """60 series of 8 runs: 3 expected with one told."""
    told = sum(any(r.told for r in runs(drawn(80, 100 + seed, 10))) for seed in range(60))
    assert told <= 9


def test_without_rig_and_day_there_are_no_runs() -> None:
    records = drawn(30, 3)
    for r in records:
        r["rig"] = r["date"] = None
    assert runs(records) == []


def series_of(records: list[dict[str, Any]], refused: dict[str, str]) -> Series:
    return Series({str(r["unit"]): {"record": r} for r in records}, refused, len(records))


@pytest.mark.parametrize("count", [0, 1, 5, 60])
def test_a_page_of_any_size(count: int) -> None:
    refused = {"U-X": 'units/U-X/unit.toml: found "<script>"'}
    files = series_files(series_of(drawn(count, 4), refused))
    page = files["series.html"].decode()
    assert f"{count} of {count + 1} unit{'s' * (count > 0)} passed" in page
    assert page.count("<script>") == 1  # that of the list
    assert "&lt;script&gt;" in page
    assert b"nan" not in files["series.json"].lower()
    assert "nan" not in page.split("</style>")[1]
    assert page.count("<h4>") == (36 if count else 0)


def test_a_verdict_other_than_passed_is_counted_and_said() -> None:
    records = drawn(30, 4)
    words = "not shown to be within the limits: error and uncertainty (95 %) reach 2 mg"
    records[3] |= {"result": "not shown", "verdict": words}
    records[7] |= {"result": "passed at the dwells", "verdict": "passed at the dwells; a < b"}
    series = series_of(records, {"U-X": "why"})
    files = series_files(series)
    page = files["series.html"].decode()
    counts = "28 passed, 1 not shown, 1 passed at the dwells, 1 refused"
    assert "<h1>28 of 31 units passed</h1>" in page
    assert counts in page
    assert words in page
    assert "a &lt; b" in page
    told = series_summary(series, 0, 1.0, 1, "p").splitlines()[0]
    assert told == f"series          31 units: {counts}"
    found = json.loads(files["series.json"])
    assert (found["units"], found["made"], found["passed"]) == (31, 30, 28)


def test_only_readings_in_one_unit_are_compared() -> None:
    """Recordings in m/s^2 beside a tilter's volts are no outliers of them, and have their unit."""
    volts, others = drawn(40, 5), drawn(25, 6)
    for r in others:
        r["unit"] = f"M{r['unit']}"
        r["reading_unit"] = "m/s^2"
        r["at_t0"] = [9.8 + 0.01 * v for v in r["at_t0"]]
    page = series_files(series_of([*volts, *others], {}))["series.html"].decode()
    assert "None: no constant or coefficient is more than" in page
    assert page.count("<h4>") == 72
    assert "25 units with readings in m/s^2" in page
    assert "mm/s²/g/°C" in page
    assert "e+0" not in page
    assert "−" in page  # a true minus
    assert {q.unit for q in quantities(others)} == {
        "m/s²/g", "mm/s²/g/°C", "µm/s²/g/°C²", "m/s²", "mm/s²/°C", "µm/s²/°C²",
    }  # fmt: skip


def test_the_same_records_give_the_same_bytes() -> None:
    assert series_files(series_of(drawn(40, 5), {})) == series_files(series_of(drawn(40, 5), {}))


MADE = (
    "made            100 units in 2 min 0 s: 50 a minute, 25 a worker; 40 were done and unchanged"
)


def test_the_terminal_names_what_stands_out() -> None:
    records = drawn(100, 6)
    records[3]["at_t0"][0] = 2.0
    for r in records[75:]:
        r["placement_pattern_g"][1][1] += 1e-4
    text = series_summary(series_of(records, {"U-X": "why"}), 40, 120.0, 2, "build/series.html")
    assert text.splitlines() == [
        "series          101 units: 100 passed, 1 refused",
        MADE,
        "outliers        U-0003",
        text.splitlines()[3],
        "page            build/series.html",
    ]
    assert text.splitlines()[3].startswith(
        "drift           1 run(s) differ significantly from the run before on the same rig; "
        "the largest: R-1 2026-01-04, "
        "placement, y pair seen by y by +"
    )
