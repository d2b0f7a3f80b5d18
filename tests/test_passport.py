"""The passport: what it says, that it is one file, and that limits are told with their factor."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from triaxcal.base.errors import RefusedError
from triaxcal.delivery.unit import Delivery, deliver
from triaxcal.delivery.verdict import UNCERTAINTY
from triaxcal.model.metrological import CONSTANT_NAMES
from triaxcal.report.files import all_files
from triaxcal.report.passport.content import Passport, passport
from triaxcal.report.passport.document import passport_json
from triaxcal.report.passport.page import passport_html
from triaxcal.report.pictures.curves import Frame, ticks
from triaxcal.report.words.numbers import g_in_words, significant, with_uncertainty

UNITS = Path(__file__).parent.parent / "units"
VOID = {"meta", "br"}


@pytest.fixture(scope="session")
def passports(delivered: dict[str, Delivery]) -> dict[str, Passport]:
    return {name: passport(delivery, {}) for name, delivery in delivered.items()}


class Tags(HTMLParser):
    """Nesting of the elements, all attributes, and the text."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.attributes += attrs
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, _tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.attributes += attrs

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def read(page: bytes) -> Tags:
    tags = Tags()
    tags.feed(page.decode())
    assert tags.open == []
    return tags


@pytest.mark.parametrize("name", ["AT-CHERNIAK", "AT-SIM"])
def test_page_is_one_well_formed_file(passports: dict[str, Passport], name: str) -> None:
    page = passport_html(passports[name])
    tags = read(page)
    assert b"http" not in page
    links = [value or "" for a, value in tags.attributes if a in ("src", "href")]
    assert len(links) == 5
    assert all(link.startswith("data:text/csv;") for link in links)
    assert not re.search(r"url\(|@import|nan|inf\b", re.sub(r"base64,[\w+/=]*", "", page.decode()))


@pytest.mark.parametrize("name", ["AT-CHERNIAK", "AT-SIM"])
def test_the_same_delivery_gives_the_same_bytes(delivered: dict[str, Delivery], name: str) -> None:
    first, second = all_files(delivered[name]), all_files(delivered[name])
    again = all_files(deliver(UNITS / name))
    assert first == second == again


def test_page_shows_constants_hashes_and_positions(passports: dict[str, Passport]) -> None:
    p = passports["AT-SIM"]
    page = passport_html(p).decode()
    text = read(page.encode()).text
    at_t0 = p.delivery.calibration.thermal.constants_at(20.0)
    for c in range(12):
        value, expanded = with_uncertainty(float(at_t0[c]), p.constant_budgets[c].expanded, 1e3)
        assert f'<td class="n">{value}</td><td class="n">{expanded}</td>' in page
        assert f'"head">{CONSTANT_NAMES[c]}<' in page
    for digest in json.loads(passport_json(p))["files_sha256"].values():
        assert digest in text
    assert p.delivery.inputs_sha256[:16] in text
    # One circle before and one after for each dwell, one for each point of the twelve curves.
    dwells = len(p.delivery.chosen.residuals)
    assert page.count("<circle") == 2 * dwells + 12 * len(p.delivery.calibration.points)


def test_marks_lie_where_the_values_are() -> None:
    frame = Frame((-40.0, 70.0), (-1.0, 3.0))
    assert (frame.x(-40.0), frame.x(70.0)) == (52.0, 216.0)
    assert (frame.y(3.0), frame.y(-1.0)) == (8.0, 130.0)
    assert ticks(-0.93, 3.07, 4) == [0.0, 1.0, 2.0, 3.0]
    assert ticks(-40.0, 70.0, 5) == [-25.0, 0.0, 25.0, 50.0]


def test_json_has_the_numbers_of_the_page(passports: dict[str, Passport]) -> None:
    p = passports["AT-SIM"]
    document = json.loads(passport_json(p))
    assert document["result"] == "passed"
    constants = document["constants_at_t0"]
    assert [c["name"] for c in constants] == list(CONSTANT_NAMES)
    for c, entry in enumerate(constants):
        assert entry["expanded_uncertainty"] == pytest.approx(
            p.uncertainty.constants_u[p.uncertainty.t0_index, c], rel=1e-9
        )
        shares = [line["share_of_variance"] for line in entry["budget"]]
        assert sum(shares) == pytest.approx(1.0)
    worst = document["acceleration"]["worst_component"]["expanded_uncertainty"]
    over = np.array(document["over_temperature"]["acceleration_expanded_uncertainty_g"])
    assert over[:, :3].max() == pytest.approx(worst)


def test_a_limit_beyond_what_is_known_is_told(passports: dict[str, Passport]) -> None:
    p = passports["AT-CHERNIAK"]
    t0, over = p.acceptance
    # Two of three temperatures may be exchanged: page, JSON and verdict say so of both limits.
    exchanged = "the order of the temperatures"
    assert t0.within
    assert not t0.shown
    assert t0.unknown == over.unknown == (exchanged,)
    assert [t.whole for t in p.verdict.tested if t.what == UNCERTAINTY] == [False, False]
    assert not over.shown
    assert over.cause == "the thermal model"
    assert not p.verdict.shown
    text = " ".join(read(passport_html(p)).text.split())
    assert "not shown to pass the uncertainty reaches beyond a limit" in text.replace(
        "pass", "pass "
    )
    assert "Error and uncertainty (95 %) reach 3.15 mg over the range (limit 1 mg)." in text
    assert f"with what is known; not in it: {exchanged}." in text
    factor = significant(over.factor, 2)
    cause = "Main cause: the thermal model. What helps: measure at one"
    assert f"reach {factor} times the limit. {cause}" in text
    assert "not known: nothing was held out" in text
    document = json.loads(passport_json(p))
    assert document["acceptance"][1]["interval_over_limit"] == over.factor
    assert [a["shown_with_uncertainty"] for a in document["acceptance"]] == [False, False]
    for budget in document["acceleration"].values():
        assert budget["budget"][0]["source"] == exchanged
        assert budget["budget"][0]["standard_uncertainty"] is None


def test_tools_and_warnings_are_shown_and_escaped(passports: dict[str, Passport]) -> None:
    p = passports["AT-SIM"]
    assert "not run on this delivery" in read(passport_html(p)).text
    found = {"gappa": {"result": "passed", "finding": "12 <lemmas> & more"}}
    warned = replace(p.uncertainty, warnings=("a < b",))
    firmware = replace(p.delivery.firmware)
    vars(firmware)["uncertainty"] = warned
    page = passport_html(Passport(replace(p.delivery, firmware=firmware), found))
    assert b"12 &lt;lemmas&gt; &amp; more" in page
    assert b"A &lt; b" in page
    assert "not run on this delivery" not in read(page).text


# ---- numbers ----


def test_digits_follow_the_uncertainty() -> None:
    assert with_uncertainty(-0.5506091236, 7.2e-6, 1e3) == ("\u2212550.6091", "0.0072")
    assert with_uncertainty(1234.6, 96.0) == ("+1235", "96")
    assert with_uncertainty(1.5, 0.0) == ("+1.500000000", "0.000000000")
    assert g_in_words(2.69e-6) == "2.69 µg"
    assert g_in_words(1e-3) == "1.00 mg"
    assert g_in_words(0.9999e-3) == "1.00 mg"
    assert g_in_words(9e-17) == "0 ng"
    assert significant(0.0) == "0"
    assert significant(1234.0) == "1200"


# ---- limits that cannot be met ----


def edited(tmp_path: Path, name: str, extra: str, change: Callable[[str], str] = str) -> Path:
    folder = tmp_path / "units" / name
    shutil.copytree(UNITS / name, folder)
    path = folder / "unit.toml"
    path.write_text(change(path.read_text(encoding="utf-8")) + extra, encoding="utf-8")
    return folder


@pytest.mark.parametrize(
    ("extra", "why"),
    [
        (
            "\n[limits]\nat_t0_g = 1e-7\nover_range_g = 1e-6\n",
            "noise and placement are too large for this limit",
        ),
        (
            '\n[compensation]\nmethod = "additive-simplified"\n[limits]\nover_range_g = 1e-4\n',
            "choose another compensation.method",
        ),
        ('model = "polynomial"\norder = 1\n', "the thermal function does not follow the unit"),
    ],
)
def test_a_limit_that_is_not_met_says_by_what_factor_and_why(
    tmp_path: Path, extra: str, why: str
) -> None:
    with pytest.raises(RefusedError) as caught:
        deliver(edited(tmp_path, "AT-SIM", extra))
    message = str(caught.value)
    assert why in message
    numbers = r"= ([\d.]+) mg in .* ([\d.e+]+) times the limit.* most ([\d.e-]+) mg"
    found = re.search(numbers, message)
    assert found is not None, message
    error, factor, limit = map(float, found.groups())
    # Four and three digits.
    assert factor == pytest.approx(error / limit, rel=0.01)


@pytest.mark.parametrize("name", ["AT-CHERNIAK", "AT-SIM"])
def test_limits_are_drawn_over_the_marks(passports: dict[str, Passport], name: str) -> None:
    """Under the stems of 64 temperatures a limit would not be seen."""
    page = passport_html(passports[name]).decode()
    pictures = [svg for svg in re.findall(r"<svg.*?</svg>", page, re.DOTALL) if "bound" in svg]
    assert pictures
    for svg in pictures:
        assert svg.rindex('class="after"') < svg.index('class="bound"')


def test_what_was_held_out_is_counted_in_dwells(passports: dict[str, Passport]) -> None:
    """As the certificate counts it: five temperatures of six positions and 36 check dwells."""
    assert "held-out errors at 66 dwells" in read(passport_html(passports["AT-SIM"])).text


def test_json_and_page_name_the_same_as_not_tested(delivered: dict[str, Delivery]) -> None:
    made = passport(delivered["AT-SIM"], {})
    said = json.loads(passport_json(made))["not_tested"]
    assert said == [
        "the C on a device of this unit",
        "the C with other tools (triaxcal verify)",
    ]
    page = passport_html(made).decode()
    assert all(f"<li>{words}</li>" in page for words in said)
    shown = passport(delivered["AT-SIM"], {"gappa": "passed"})
    assert json.loads(passport_json(shown))["not_tested"] == said[:1]
