"""What the pages say of the code is what the code has: tables, and the names of the API."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

import triaxcal

DOCS = Path(__file__).parent.parent / "docs"
sys.path.insert(0, str(DOCS / "_ext"))

import generated  # noqa: E402


@pytest.mark.parametrize("page", generated.pages(), ids=lambda p: str(p.relative_to(DOCS)))
def test_the_tables_of_a_page_are_up_to_date(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert generated.filled(text) == text, "run `make golden`, and look at the difference"


@pytest.mark.parametrize("name", sorted(generated.TABLES))
def test_every_table_stands_in_a_page(name: str) -> None:
    texts = [page.read_text(encoding="utf-8") for page in generated.pages()]
    assert any(f"<!-- generated: {name}" in text for text in texts)


def test_the_reference_has_every_public_name() -> None:
    text = (DOCS / "reference/python.md").read_text(encoding="utf-8")
    named = re.findall(r"^\.\. auto\w+:: (\w+)", text, re.MULTILINE)
    assert sorted(named) == sorted(set(triaxcal.__all__) - {"__version__"})
