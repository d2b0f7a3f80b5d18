"""Links and paths in the project's texts lead somewhere; `make docs` checks those of the site."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from triaxcal import __version__

REPO = Path(__file__).parent.parent
OUTSIDE_THE_SITE = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "examples/cortex-m3/README.md")


@pytest.mark.parametrize("name", OUTSIDE_THE_SITE)
def test_links_outside_the_site_lead_somewhere(name: str) -> None:
    page = REPO / name
    links = re.findall(r"\]\(([^)#\s]+)[^)]*\)", page.read_text(encoding="utf-8"))
    local = [link for link in links if "://" not in link]
    assert [link for link in local if not (page.parent / link).exists()] == []


def test_the_citation_has_the_version_of_the_package() -> None:
    assert f"\nversion: {__version__}\n" in (REPO / "CITATION.cff").read_text(encoding="utf-8")
