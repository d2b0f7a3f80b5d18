"""Links and paths in the project's texts lead somewhere; `make docs` checks those of the site."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from triaxcal import __version__

REPO = Path(__file__).parent.parent
OUTSIDE_THE_SITE = (
    "README.md", "CONTRIBUTING.md", "CHANGELOG.md", "examples/cortex-m3/README.md",
    "docs/can.md", "docs/file-formats.md", "docs/fixed-point.md", "docs/targets.md",
)  # fmt: skip
NAMING_PAGES = ("toolchain", "templates", "firmware_ref", "tests", "units", "rig", "bench", "fuzz")


@pytest.mark.parametrize("name", OUTSIDE_THE_SITE)
def test_links_outside_the_site_lead_somewhere(name: str) -> None:
    page = REPO / name
    links = re.findall(r"\]\(([^)#\s]+)[^)]*\)", page.read_text(encoding="utf-8"))
    local = [link for link in links if "://" not in link]
    assert [link for link in local if not (page.parent / link).exists()] == []


def test_the_citation_has_the_version_of_the_package() -> None:
    assert f"\nversion: {__version__}\n" in (REPO / "CITATION.cff").read_text(encoding="utf-8")


@pytest.mark.parametrize("folder", NAMING_PAGES)
def test_pages_named_in_code_messages_and_files_exist(folder: str) -> None:
    texts = {
        path: path.read_text(encoding="utf-8")
        for suffix in ("py", "j2", "c", "h", "toml", "dbc")
        for path in (REPO / folder).rglob(f"*.{suffix}")
    }
    named = {page for text in texts.values() for page in re.findall(r"docs/[a-z/-]+\.md", text)}
    assert [page for page in sorted(named) if not (REPO / page).exists()] == []
