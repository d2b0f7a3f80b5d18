"""The passport in its languages: one table of texts, and nothing of the page beside it."""

from __future__ import annotations

import html
import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from triaxcal.base.errors import RefusedError
from triaxcal.delivery.unit import Delivery
from triaxcal.report.files import all_files, passport_files
from triaxcal.report.passport.content import Passport, passport
from triaxcal.report.passport.page import passport_html
from triaxcal.report.texts.languages import language
from triaxcal.report.texts.phrases import Pattern, Phrases
from triaxcal.report.texts.speaker import speaker
from triaxcal.unit.description import read_unit
from triaxcal.unit.passport import CODES, ENGLISH

ROOT = Path(__file__).parent.parent
OTHERS = [code for code in CODES if code != ENGLISH]
PLACE = re.compile(r"\{\w+\}")
SYMBOLS = {
    "arcsec", "bit", "csv", "gcc", "inputs", "int32", "micro", "min", "sd", "serial", "sha256",
    "sqrt", "count", "triaxcal", "verify", "device",
    # Names of compensation methods, of keys, and of files.
    "matrix", "inverse", "additive", "method", "batch",
}  # fmt: skip
"""Words that stand in a page of any language: units, and names in files and commands."""


@pytest.fixture(scope="session")
def doubtful(delivered: dict[str, Delivery]) -> Passport:
    return passport(delivered["AT-CHERNIAK"], {})


def texts(page: bytes) -> Iterator[str]:
    """Every text of a page, those of attributes for people too, without what is said in English."""
    source = re.sub(r"<(script|style)>.*?</\1>", "", page.decode(), flags=re.DOTALL)
    source = re.sub(r'<(span|td) lang="en">.*?</\1>', "", source, flags=re.DOTALL)
    yield from map(html.unescape, re.findall(r'(?:aria-label|alt)="([^"]*)"', source))
    yield from map(html.unescape, re.findall(r">([^<]+)<", source))


def english_words(page: bytes) -> set[str]:
    """Words of small Latin letters, without names with a dot, a sign or a figure in them."""
    found: set[str] = set()
    for text in texts(page):
        plain = re.sub(r"\S*[._\[\]/…=0-9]\S*", " ", text)
        found |= set(re.findall(r"(?<![\w-])[a-z]{3,}(?![\w-])", plain))
    return found - SYMBOLS


@pytest.mark.parametrize("code", OTHERS)
def test_every_language_has_the_keys_and_places_of_english(code: str) -> None:
    english, other = language(ENGLISH), language(code)
    for own, others in ((english.texts, other.texts), (english.said, other.said)):
        assert set(own) == set(others)
        for key, text in own.items():
            assert sorted(PLACE.findall(text)) == sorted(PLACE.findall(others[key])), key
            assert others[key].strip(), key


def test_every_key_of_the_table_is_used() -> None:
    sources = [*(ROOT / "templates" / "pages").iterdir()]
    sources += (ROOT / "toolchain" / "triaxcal" / "report").rglob("*.py")
    text = "\n".join(path.read_text(encoding="utf-8") for path in sources)
    made = re.compile(r'"(\w+)\.\{')  # keys that are put together
    starts = set(made.findall(text)) | {f"{a}.{b}" for a, b in re.findall(r'"(\w+)\.(\w+)\{', text)}
    for key in language(ENGLISH).texts:
        together = key.split(".")[0] in starts or any(key.startswith(s) for s in starts if "." in s)
        assert together or f'"{key}"' in text or f"'{key}'" in text, key


@pytest.mark.parametrize("code", ["uk", "zh"])
@pytest.mark.parametrize("name", ["AT-CHERNIAK", "AT-SIM"])
def test_no_english_word_escapes_the_table(
    delivered: dict[str, Delivery], code: str, name: str
) -> None:
    page = passport_html(passport(delivered[name], {}), code)
    assert f'<html lang="{code}">'.encode() in page
    assert b'lang="en"' not in page
    assert english_words(page) == set()


def test_the_search_for_english_finds_it(doubtful: Passport) -> None:
    words = english_words(passport_html(doubtful, ENGLISH))
    assert {"uncertainty", "temperature", "residuals", "limit"} <= words


def test_what_has_no_translation_is_marked_as_english(doubtful: Passport) -> None:
    uncertainty = replace(doubtful.uncertainty, warnings=("the moon <was> full",))
    firmware = replace(doubtful.delivery.firmware)
    vars(firmware)["uncertainty"] = uncertainty
    p = Passport(replace(doubtful.delivery, firmware=firmware), {})
    assert b'<span lang="en">The moon &lt;was&gt; full</span>' in passport_html(p, "de")
    assert b'<span lang="en">' not in passport_html(p, ENGLISH)


@pytest.mark.parametrize("code", OTHERS)
def test_the_verdict_is_said_in_the_language(doubtful: Passport, code: str) -> None:
    page = html.unescape(passport_html(doubtful, code).decode())
    own = language(code)
    assert own.texts["result.not_shown"] in page
    between = speaker(code).say("between the temperatures not tested", capital=True)
    assert f"{html.unescape(str(between))}." in page
    assert own.said["sources.exchanged"] in page


def test_sentences_are_recognized_by_their_patterns() -> None:
    english = {"a": "{count} of {what} fail", "b": "red apples", "c": "at {t} degC", "d": "worse"}
    other = {"a": "{what}: {count}", "b": "rote Äpfel", "c": "bei {t} degC", "d": "ärger"}
    phrases = Phrases(english, other)
    assert phrases.said("3 of red apples fail") == "rote Äpfel: 3"
    assert phrases.said("Red apples.") == "Rote Äpfel."
    assert phrases.said("worse; at -40 °C") == "ärger; bei -40 degC"
    # A word that is not known, and a number that is none: no half translation.
    assert phrases.said("3 of green apples fail") is None
    assert phrases.said("most of red apples fail") is None
    assert phrases.said("worse; better") is None


def test_a_pattern_gives_back_what_it_was_filled_with() -> None:
    pattern = Pattern.of("{a}, bias by {b}: {c}")
    values = {"a": "line, knots 1, 2", "b": "mean", "c": "x: y"}
    assert pattern.match(pattern.filled(values)) == values


def edited(tmp_path: Path, languages: str) -> Path:
    folder = tmp_path / "units" / "AT-SIM"
    shutil.copytree(ROOT / "units" / "AT-SIM", folder)
    path = folder / "unit.toml"
    text = path.read_text(encoding="utf-8")
    path.write_text(f"{text}\n[passport]\nlanguages = {languages}\n", encoding="utf-8")
    return folder


def test_a_unit_states_the_languages(delivered: dict[str, Delivery], tmp_path: Path) -> None:
    unit = read_unit(edited(tmp_path, '["uk", "en"]'))
    assert unit.languages == ("uk", "en")
    of = delivered["AT-SIM"]
    made = passport(replace(of, unit=replace(of.unit, languages=unit.languages)), {})
    files = passport_files(made)
    assert sorted(files) == ["passport.en.html", "passport.html", "passport.json"]
    assert b'<html lang="uk">' in files["passport.html"]
    assert files["passport.en.html"] == passport_html(passport(of, {}))
    assert sorted(n for n in all_files(of) if "passport" in n) == ["passport.html", "passport.json"]


@pytest.mark.parametrize(
    ("languages", "message"),
    [
        ('["fr"]', "expected a list of different languages of en, de, uk, zh"),
        ('["en", "en"]', "expected a list of different languages of en, de, uk, zh"),
        ("[]", "expected a list of different languages of en, de, uk, zh"),
        ('"en"', "expected a list of different languages of en, de, uk, zh"),
        ('["../en"]', "expected a list of different languages of en, de, uk, zh"),
    ],
)
def test_a_language_that_is_not_there_is_refused(
    tmp_path: Path, languages: str, message: str
) -> None:
    with pytest.raises(RefusedError, match=re.escape(message)) as caught:
        read_unit(edited(tmp_path, languages))
    assert "[passport] languages" in str(caught.value)
    with pytest.raises(RefusedError, match="expected one of en, de, uk, zh"):
        language("fr")
