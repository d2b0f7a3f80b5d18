"""Tables in the pages that come from the code are as the code has them."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

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
