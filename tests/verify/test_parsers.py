"""Whatever stands in a unit's files, the readers raise RefusedError in one line, or nothing."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from triaxcal.base.errors import RefusedError
from triaxcal.readings.measurements import read_measurements
from triaxcal.unit.description import read_unit
from verify.conftest import UNITS

PIECES = st.sampled_from([
    "nan", "inf", "-inf", "1e999", "-0.0", "9" * 400, "0x10", "1_0", "", '"', "'", "[", "]", "{",
    "}", "=", ",", ";", "\t", "\r", "\n", "\r\n", "#", "\ufeff", "\x00", "\u2028", "\u00b5",
    "\u0663",
    "true", "[adc]", "1979-05-27", "TP1", "temp_degc", "position", '"""', "\\", "\u00e9" * 300,
])  # fmt: skip


@st.composite
def damaged(draw: st.DrawFn, file: str) -> bytes:
    """A shipped file with pieces cut, repeated, replaced; at times with bytes that are no text."""
    text = (UNITS / draw(st.sampled_from(["AT-SIM", "AT-CHERNIAK"])) / file).read_text()
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(text)))
        end = min(len(text), start + draw(st.integers(0, 30)))
        text = text[:start] + draw(PIECES) + text[start + (end - start) * draw(st.integers(0, 1)) :]
    content = text.encode("utf-8", "surrogatepass")
    if draw(st.integers(0, 9)) == 0:
        at = draw(st.integers(0, len(content)))
        content = content[:at] + draw(st.binary(min_size=1, max_size=4)) + content[at:]
    return content


def refused_or_read(read: Callable[[], object]) -> None:
    text = "read"
    try:
        read()
    except RefusedError as refusal:
        text = str(refusal)
    assert text
    assert "\n" not in text


@pytest.fixture(scope="module")
def folder() -> object:
    with tempfile.TemporaryDirectory() as name:
        unit = Path(name) / "FUZZ"
        unit.mkdir()
        yield unit


@settings(max_examples=400)
@given(content=damaged("unit.toml") | st.binary(max_size=300))
def test_unit_toml(folder: Path, content: bytes) -> None:
    (folder / "unit.toml").write_bytes(content)
    refused_or_read(lambda: read_unit(folder))


@settings(max_examples=400)
@given(content=damaged("measurements.csv") | st.binary(max_size=300))
def test_measurements_csv(folder: Path, content: bytes) -> None:
    unit = read_unit(UNITS / "AT-SIM")
    path = folder / "measurements.csv"
    path.write_bytes(content)
    refused_or_read(lambda: read_measurements(path, unit))
