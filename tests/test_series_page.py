"""The list of a series, its histograms and numbers, as they stand on the page."""

from __future__ import annotations

import base64
import csv
import io
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from test_series_statistics import drawn, series_of
from triaxcal.report.pictures.series import error_histogram, histogram
from triaxcal.report.series.page import series_files
from triaxcal.report.series.units import href, rows_of
from triaxcal.report.words.numbers import scaled

HOSTILE = "<img src=x onerror=alert(1)>&\"'</script>"


class Page(HTMLParser):
    """Rows of the list as texts, attributes of every element, titles of bars."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.keys: list[list[str | None]] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.titles: list[str] = []
        self._inside = self._title = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        self.tags.append((tag, found))
        if tag == "table":
            self._inside = found.get("id") == "units"
        if self._inside and tag == "tr":
            self.rows.append([])
            self.keys.append([])
        if self._inside and tag in {"td", "th"}:
            self.rows[-1].append("")
            self.keys[-1].append(found.get("data-key"))
        self._title = tag == "title"

    def handle_endtag(self, tag: str) -> None:
        self._inside &= tag != "table"
        self._title = False

    def handle_data(self, data: str) -> None:
        if self._inside and self.rows and self.rows[-1]:
            self.rows[-1][-1] += data.strip()
        if self._title:
            self.titles.append(data)


def limits(record: dict[str, Any], share: float) -> None:
    record["acceptance"] = [
        {
            "where": where,
            "limit_g": limit_g,
            "largest_residual_g": share * limit_g,
            "expanded_uncertainty_g": 0.1 * limit_g,
        }
        for where, limit_g in (("at T0", 3e-4), ("over the range", 1e-3))
    ]


def mixed(count: int = 25) -> list[dict[str, Any]]:
    records = drawn(count, 5)
    for k, record in enumerate(records):
        limits(record, 0.2 + 0.01 * k)
        record["kind"] = ("tilter", "faces", "poses")[k % 3]
    del records[1]["kind"]  # a journal of an earlier version
    records[2]["rig"] = HOSTILE
    records[3] |= {"result": "not shown", "verdict": f"not shown: {HOSTILE}"}
    return records


def page_of(records: list[dict[str, Any]], refused: dict[str, str], **skipped: str) -> Page:
    series = series_of(records, refused)
    series.skipped.update(skipped)
    return Page(series_files(series)["series.html"].decode())


def test_every_unit_stands_in_the_list_with_its_passport_or_the_reason() -> None:
    page = page_of(mixed(), {"U-X": f"U-X/unit.toml: {HOSTILE}"}, IMU="an IMU")
    head, *rows = page.rows
    assert len(head) == 10
    assert {len(row) for row in rows} == {10}
    by_name = {row[0]: row for row in rows}
    assert list(by_name) == sorted(by_name)
    assert len(by_name) == 27
    assert by_name["U-X"][3] == f"refusedU-X/unit.toml: {HOSTILE}"
    assert by_name["IMU"][2:4] == ["IMU", "not in the seriesan IMU"]
    assert by_name["U-0003"][3] == f"not shownnot shown: {HOSTILE}"
    assert by_name["U-0001"][2] == "tilter"
    assert by_name["U-0005"][2:7] == ["poses", "passed", "0.0750", "0.250", "0.350"]
    links = {a["href"] for tag, a in page.tags if tag == "a"}
    assert {f"./U-{k:04d}/passport.html" for k in range(25)} <= links
    assert not any("U-X" in str(link) or "IMU" in str(link) for link in links)


def test_the_list_is_sorted_by_numbers_where_they_are_numbers() -> None:
    rows = page_of(mixed(), {}).keys[1:]
    assert [float(str(row[5])) for row in rows] == pytest.approx(
        [1e-3 * (0.2 + 0.01 * k) for k in range(25)]
    )


def test_the_page_is_one_file_and_nothing_on_it_is_run_or_loaded() -> None:
    page = page_of(mixed(), {"U-X": HOSTILE})
    assert not [tag for tag, _ in page.tags if tag in {"img", "link", "iframe", "object"}]
    assert [a for tag, a in page.tags if tag == "script"] == [{}]
    assert not [k for _, attributes in page.tags for k in attributes if k.startswith("on")]
    text = series_files(series_of(mixed(), {}))["series.html"].decode()
    assert not re.search(r"https?://|url\(|@import", text)


def test_every_value_is_escaped_whatever_the_template_says_of_it() -> None:
    """Days, quantities and results come from the journal, which anybody can edit."""
    records = mixed()
    for record in records[4:12]:
        record |= {"rig": "R", "date": HOSTILE, "result": HOSTILE, "verdict": HOSTILE}
    page = page_of(records, {})
    assert not [tag for tag, _ in page.tags if tag == "img"]
    assert [row[9] for row in page.rows].count(HOSTILE) == 8


def test_an_imu_that_was_calibrated_beside_the_series_is_linked(tmp_path: Path) -> None:
    series = series_of([], {})
    series.skipped.update(A="an IMU", B="an IMU")
    (tmp_path / "B").mkdir()
    (tmp_path / "B" / "dynamic.html").touch()
    assert [row.href for row in rows_of(series, tmp_path)] == ["", "./B/dynamic.html"]


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("U-1", "./U-1/passport.html"),
        ("javascript:alert(1)", "./javascript%3Aalert%281%29/passport.html"),
        ('a"b<c', "./a%22b%3Cc/passport.html"),
        ("..", "./../passport.html"),
        ("\udcff", "./%FF/passport.html"),
    ],
)
def test_addresses_are_relative_and_quoted(name: str, expected: str) -> None:
    assert href(name, "passport.html") == expected


def test_a_name_that_is_no_text_stands_on_page_and_in_json() -> None:
    """A folder may be named by any bytes; such a unit is refused, and listed."""
    files = series_files(series_of(drawn(1, 4), {"bad\udcff": "found 'bad\udcff'"}))
    assert json.loads(files["series.json"])["refused"] == {"bad\udcff": "found 'bad\udcff'"}
    assert any("bad" in row[0] for row in Page(files["series.html"].decode()).rows[1:])


def test_the_csv_has_the_list() -> None:
    page = page_of(mixed(), {"U-X": "=1+1", "U-Y": "+why"})
    (address,) = [a["href"] for tag, a in page.tags if tag == "a" and "download" in a]
    coded = str(address).removeprefix("data:text/csv;charset=utf-8;base64,")
    rows = list(csv.DictReader(io.StringIO(base64.b64decode(coded).decode())))
    assert len(rows) == 27
    assert float(rows[5]["largest_error_range_g"]) == 1e-3 * (0.2 + 0.05)
    assert rows[2]["rig"] == HOSTILE
    assert [row["why"] for row in rows if row["verdict"] == "refused"] == ["'=1+1", "'+why"]


@pytest.mark.parametrize("share", [3.1, 310.0, 1e-4])
def test_shares_of_a_limit_have_no_exponent(share: float) -> None:
    records = drawn(3, 4)
    for record in records:
        limits(record, share)
    text = series_files(series_of(records, {}))["series.html"].decode()
    shown = {3.1: "310 %", 310.0: "31000 %", 1e-4: "0.01 %"}[share]
    assert f'<td class="n">{shown}</td>' in text
    assert not re.search(r"\d[eE][+-]\d", re.sub(r'data-key="[^"]*"|base64,[^"]*', "", text))


def test_a_histogram_counts_every_unit_and_says_where() -> None:
    errors = np.array([0.1, 0.1, 0.12, 0.5, 1.2])
    picture = error_histogram(errors, 1.0, "over the range")
    counts = [int(bar["title"].split()[0]) for bar in picture["bars"]]
    assert sum(counts) == 5
    assert [bar["title"].split()[0] for bar in picture["bars"] if bar["kind"] == "far"] == ["1"]
    assert picture["bars"][0]["title"].endswith(" mg")
    assert picture["limits"][0]["title"].startswith("limit 1.00 mg")
    assert picture["counts"][0]["label"] == "0"
    assert picture["axis_unit"] == "mg"


def test_a_limit_far_beyond_the_errors_is_said_and_not_drawn() -> None:
    picture = error_histogram(np.array([0.01, 0.011]), 1.0, "at T0")
    assert picture["limits"] == []
    assert picture["beyond"] == "limit 1.00 mg"


def test_dashed_lines_are_where_far_begins() -> None:
    from triaxcal.batch.statistics import outlier_factor, quantities

    records = drawn(60, 6)
    q = quantities(records)[0]
    factor = outlier_factor(60, 36)
    records[3]["at_t0"][0] = (q.median + 2 * factor * q.spread) / 1e3
    records[4]["at_t0"][0] = (q.median - 2 * factor * q.spread) / 1e3
    q = quantities(records)[0]
    assert len(histogram(q, records, [], factor)["limits"]) == 2
    assert histogram(q, records, [], None)["limits"] == []


@pytest.mark.parametrize("value", [1e-12, 3e-7, 0.0, 5.0, -2e6, 7e11])
def test_an_axis_has_short_numbers_whatever_the_values_are(value: float) -> None:
    records = drawn(5, 7)
    for k, record in enumerate(records):
        record["at_t0"][0] = value * (1 + 0.1 * k)
    from triaxcal.batch.statistics import quantities

    picture = histogram(quantities(records)[0], records, [])
    labels = [m["label"] for m in picture["labels"]]
    assert labels
    assert max(map(len, labels)) <= 9
    assert len(set(labels)) == len(labels)


@pytest.mark.parametrize(
    ("value", "scale", "digits", "text"),
    [
        (310.123, 310.0, 3, "310"),
        (-0.004, 1.0, 2, "0.0"),
        (-1.26, 0.1, 2, "−1.26"),
        (0.0, 0.0, 3, "0"),
        (123456.0, 1000.0, 2, "123500"),
        (5e-13, 5e-13, 3, "5.00·10⁻¹³"),
    ],
)
def test_numbers_to_the_digits_of_a_scale(
    value: float, scale: float, digits: int, text: str
) -> None:
    assert scaled(value, scale, digits) == text
