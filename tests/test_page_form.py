"""The passport's page: valid, readable by everyone, its code scanned, its numbers to be had."""

from __future__ import annotations

import base64
import csv
import hashlib
import io
import itertools
import re
from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np
import pytest

from triaxcal.codegen.names import names_of
from triaxcal.delivery.unit import Delivery
from triaxcal.model.metrological import CONSTANT_NAMES
from triaxcal.report.passport.content import Passport, passport
from triaxcal.report.passport.page import passport_html
from triaxcal.report.passport.qrcode import qr_code, qr_text
from triaxcal.report.passport.tables import acceptance
from triaxcal.report.texts.html import css_text
from triaxcal.report.texts.speaker import speaker
from triaxcal.unit.certificate import CertificateDetails
from triaxcal.unit.equipment import Equipment
from triaxcal.unit.measured import Measured
from triaxcal.unit.passport import CODES

PAGES = Path(__file__).parent.parent / "templates" / "pages"
HOSTILE = "\"'><script>alert(1)</script></style></title>&amp;{{ 7 * 7 }}\\000041"


@pytest.fixture(scope="session")
def sim(delivered: dict[str, Delivery]) -> Passport:
    return passport(delivered["AT-SIM"], {})


def hostile(p: Passport) -> Passport:
    """Every text that a laboratory states is an attempt to get out of its place."""
    texts = dict.fromkeys(
        ("identifier", "laboratory", "city", "customer", "signer", "manufacturer",
         "laboratory_address", "laboratory_contact", "accreditation", "customer_address",
         "signer_role", "second_signer", "second_signer_role", "model"), HOSTILE,
    )  # fmt: skip
    day = date(2026, 3, 30)
    details = CertificateDetails(country="UA", begin=day, end=day, issued=day, **texts)
    names = ("name", "manufacturer", "model", "serial", "certificate", "traceable_to")
    unit = replace(
        p.delivery.unit,
        serial=HOSTILE,
        certificate=details,
        measured=Measured(rig=HOSTILE, date=day, place=HOSTILE, operator=HOSTILE),
        equipment=(
            Equipment(calibrated=day, due=date(2026, 1, 1), **dict.fromkeys(names, HOSTILE)),
        ),
    )
    return passport(replace(p.delivery, unit=unit), p.tools)


@pytest.mark.parametrize("code", CODES)
def test_the_page_is_valid_html(sim: Passport, code: str) -> None:
    html5lib = pytest.importorskip("html5lib")
    parser = html5lib.HTMLParser(strict=True, namespaceHTMLElements=False)
    tree = parser.parse(passport_html(hostile(sim), code).decode())
    assert tree.get("lang") == code
    ids = [e.get("id") for e in tree.iter() if e.get("id")]
    assert len(ids) == len(set(ids))
    named = {e.get("aria-labelledby") for e in tree.iter() if e.get("aria-labelledby")}
    assert named <= set(ids)


def test_hostile_text_stays_text(sim: Passport) -> None:
    html5lib = pytest.importorskip("html5lib")
    page = passport_html(hostile(sim)).decode()
    tree = html5lib.parse(page, namespaceHTMLElements=False)
    assert len(tree.findall(".//script")) == len(tree.findall(".//style")) == 1
    assert "alert(1)" not in "".join(tree.find(".//script").itertext())
    style = "".join(tree.find(".//style").itertext())
    assert "<" not in style
    assert style.count('"') % 2 == 0
    shown = "".join(tree.find("body").itertext())
    assert shown.count(HOSTILE) >= 20
    assert "{{ 7 * 7 }}" in shown


def test_text_in_a_style_sheet_cannot_leave_its_quotes() -> None:
    assert css_text('a"b') == "a\\22 b"
    assert css_text("серія 第") == "\\441 \\435 \\440 \\456 \\44f  \\7b2c "
    assert set(css_text(HOSTILE)) <= set("\\ -_.abcdefghijklmnopqrstuvwxyz0123456789")


def test_headings_go_down_by_one_and_tables_have_heads(sim: Passport) -> None:
    page = passport_html(hostile(sim)).decode()
    levels = [int(level) for level in re.findall(r"<h(\d)", page)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after - before <= 1 for before, after in itertools.pairwise(levels))
    tables = re.findall(r"<table.*?</table>", page, re.DOTALL)
    assert len(tables) >= 7
    for table in tables:
        assert "<caption>" in table
        assert all("scope=" in head for head in re.findall(r"<th[ >][^>]*>?", table))
    for picture in re.findall(r"<svg.*?</svg>", page, re.DOTALL):
        assert 'role="img"' in picture.split(">")[0]
        assert re.match(r"<svg[^>]*><title id=", picture)


def test_tables_and_panels_stay_whole_on_paper() -> None:
    css = (PAGES / "page_style.css.j2").read_text(encoding="utf-8")
    css += (PAGES / "passport_style.css.j2").read_text(encoding="utf-8")
    for rule in ("tr", "figure", ".panels > div", ".sign", ".limit", " .scroll:not(.tall)"):
        assert re.search(re.escape(f"{rule} {{") + r"[^}]*break-inside: avoid", css), rule
    assert "thead { display: table-header-group; }" in css


@pytest.mark.parametrize(
    ("code", "words"),
    [("en", ["page ", " of ", ""]), ("zh", ["第 ", " 页，共 ", " 页"])],
)
def test_every_printed_page_has_serial_number_and_its_own(
    sim: Passport, code: str, words: list[str]
) -> None:
    page = passport_html(sim, code).decode()
    before, between, after = map(css_text, words)
    numbers = f'"{before}" counter(page) "{between}" counter(pages) "{after}"'
    assert f"@bottom-right {{ content: {numbers};" in page
    foot = re.search(r'@bottom-left \{ content: "([^"]*)"', page)
    assert foot is not None
    assert foot[1].endswith("AT-SIM-001")


# ---- contrast ----

LEAST_TEXT, LEAST_DRAWING = 4.5, 3.0
"""WCAG 2.2, 1.4.3 and 1.4.11."""
BACKGROUNDS = {"--paper", "--tint"}


def colours(css: str) -> list[dict[str, str]]:
    """The colours of light and of dark mode, by their names."""
    roots = re.findall(r":root \{([^}]*)\}", css)
    light, dark = (dict(re.findall(r"(--[\w-]+): (#[0-9a-f]+)", root)) for root in roots)
    return [light, light | dark]


def luminance(colour: str) -> float:
    """WCAG 2.2, relative luminance."""
    parts = [int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5)]
    linear = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
    return float(np.dot([0.2126, 0.7152, 0.0722], linear))


def contrast(one: str, other: str) -> float:
    high, low = sorted((luminance(one), luminance(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


def test_every_text_and_mark_is_seen_in_both_modes() -> None:
    css = (PAGES / "page_style.css.j2").read_text(encoding="utf-8")
    css += (PAGES / "passport_style.css.j2").read_text(encoding="utf-8")
    rules = re.findall(r"([^{}]+)\{([^{}]*)\}", css)
    badges = [re.search(r"background: var\((--\w+)\)", body) for s, body in rules if ".badge" in s]
    of_badges = {found[1] for found in badges if found}
    assert of_badges == {"--good", "--warn"}
    texts, marks = set(), set()
    for selector, body in rules:
        texts |= set(re.findall(r"(?<![\w-])color: var\((--[\w-]+)\)", body))
        if "text" in selector:
            texts |= set(re.findall(r"fill: var\((--[\w-]+)\)", body))
        elif not any(name in selector for name in (".area", ".fit", ".spot", ".grid")):
            marks |= set(re.findall(r"(?:fill|stroke): var\((--[\w-]+)\)", body))
    assert texts == {"--ink", "--soft", "--good", "--warn", "--blue", "--on-badge"}
    assert {"--blue", "--red", "--limit", "--grey"} <= marks
    for mode in colours(css):
        for text in texts:
            under = of_badges if text == "--on-badge" else BACKGROUNDS
            for ground in under:
                assert contrast(mode[text], mode[ground]) >= LEAST_TEXT, (text, ground)
        for mark in marks:
            assert contrast(mode[mark], mode["--paper"]) >= LEAST_DRAWING, mark


def test_the_ratio_is_that_of_the_standard() -> None:
    assert contrast("#ffffff", "#000000") == pytest.approx(21.0)
    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.005)


# ---- the code to scan ----


def module_matrix(page: str) -> np.ndarray:
    """The code as it is drawn on the page, eight pixels a module."""
    size, path = re.search(
        r'<figure class="qr">\s*<svg viewBox="0 0 (\d+) \d+".*?class="module" d="([^"]*)"',
        page,
        re.DOTALL,
    ).groups()  # type: ignore[union-attr]
    matrix = np.full((int(size), int(size)), 255, dtype=np.uint8)
    for x, y, width in re.findall(r"M(\d+) (\d+)h(\d+)v1h-\d+z", path):
        matrix[int(y), int(x) : int(x) + int(width)] = 0
    return np.kron(matrix, np.ones((8, 8), dtype=np.uint8))


def test_another_program_scans_the_code(sim: Passport) -> None:
    zxingcpp = pytest.importorskip("zxingcpp")
    image = sim.delivery.files[names_of(sim.delivery.plan).file("triax_calib.bin")]
    digest = hashlib.sha256(image).hexdigest()
    (found,) = zxingcpp.read_barcodes(module_matrix(passport_html(sim).decode()))
    assert found.text == f"unit AT-SIM\nserial AT-SIM-001\nimage sha256 {digest}"
    made = hostile(sim)
    (found,) = zxingcpp.read_barcodes(module_matrix(passport_html(made).decode()))
    assert found.text == qr_text(made)
    assert f"certificate {HOSTILE}" in found.text


# ---- downloads ----


def tables(page: str) -> dict[str, list[dict[str, str]]]:
    found = {}
    for name, content in re.findall(r'download="([^"]*)" href="data:[^,]*;base64,([^"]*)"', page):
        text = base64.b64decode(content, validate=True).decode()
        found[name] = list(csv.DictReader(io.StringIO(text)))
    return found


def test_a_number_of_any_length_has_a_code(sim: Passport) -> None:
    """The number of a certificate has no limit of length; the largest code has one."""
    day = date(2026, 3, 30)
    words = dict.fromkeys(("laboratory", "city", "customer", "signer", "manufacturer"), "x")
    details = CertificateDetails(identifier="ü" * 3000, country="UA", begin=day, end=day, **words)
    made = passport(replace(sim.delivery, unit=replace(sim.delivery.unit, certificate=details)), {})
    assert f"certificate {'ü' * 200}\nimage sha256 " in qr_text(made)
    assert qr_code(made, speaker("en"))["path"]


def test_unknown_sources_are_escaped_once(sim: Passport) -> None:
    """Names that have no translation are marked as English, and the mark is no text."""
    known = replace(sim.acceptance[0], unknown=("the board's <b>", "the noise of a board"))
    text = acceptance(known, sim, speaker("de"))["text"]
    assert '<span lang="en">the board&#39;s &lt;b&gt;</span>, <span lang="en">the noise' in text


def test_the_numbers_behind_the_pictures_can_be_had(sim: Passport) -> None:
    found = tables(passport_html(sim).decode())
    names = ("constants", "curves", "residuals", "uncertainty", "budgets")
    assert list(found) == [f"AT-SIM-001-{name}.csv" for name in names]
    thermal, u = sim.delivery.calibration.thermal, sim.uncertainty
    constants = found["AT-SIM-001-constants.csv"]
    assert [row["constant"] for row in constants] == list(CONSTANT_NAMES)
    np.testing.assert_array_equal(
        [float(row["value"]) for row in constants], thermal.constants_at(20.0)
    )
    curves = [r for r in found["AT-SIM-001-curves.csv"] if r["what"] == "curve"]
    np.testing.assert_array_equal(
        [float(row["U0x_V"]) for row in curves], thermal.constants_at(u.temps_degc)[:, 9]
    )
    np.testing.assert_array_equal([float(row["U_U0x"]) for row in curves], u.constants_u[:, 9])
    residuals = found["AT-SIM-001-residuals.csv"]
    chosen = sim.delivery.chosen.residuals
    assert [float(row["compensated_g"]) for row in residuals] == [r.error_g for r in chosen]
    assert {row["limit_g"] for row in residuals} == {"0.0003", "0.001"}
    assert len(found["AT-SIM-001-uncertainty.csv"]) == len(u.temps_degc)
    shares = [float(r["share_of_variance"]) for r in found["AT-SIM-001-budgets.csv"]]
    assert sum(shares) == pytest.approx(2.0)


def test_no_cell_of_a_download_is_a_formula(sim: Passport) -> None:
    line = sim.component_budget.lines[0]
    source = replace(line.source, origin='=HYPERLINK("x")')
    p = replace(sim)
    vars(p)["component_budget"] = replace(
        sim.component_budget, lines=(replace(line, source=source),)
    )
    found = tables(passport_html(p).decode())["AT-SIM-001-budgets.csv"]
    assert found[0]["origin"] == '\'=HYPERLINK("x")'
    name = re.search(r'download="([^"]*)"', passport_html(hostile(sim)).decode())
    assert name is not None
    assert re.fullmatch(r"[\w.-]+", name[1], re.ASCII)


# ---- values at the marks ----


def test_every_mark_says_its_values(sim: Passport) -> None:
    page = passport_html(sim).decode()
    residuals = sim.delivery.chosen.residuals
    assert len(re.findall(r"<title>[TC]P\d, [^<]* °C: ", page)) == len(residuals)
    points = len(sim.delivery.calibration.points)
    assert len(re.findall(r'<circle class="fit"[^>]*><title>', page)) == 12 * points
    assert len(re.findall(r'<rect class="spot"[^>]*><title>', page)) >= 20
