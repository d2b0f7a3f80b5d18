"""Writes external-links.txt beside the pages: what only a browser with a network can check."""

from __future__ import annotations

from pathlib import Path

from docutils import nodes
from sphinx.application import Sphinx


def setup(app: Sphinx) -> dict[str, bool]:
    """Collect links while pages are written; one process, as the list is not merged."""
    found: set[str] = set()

    def collect(_app: Sphinx, tree: nodes.document, _page: str) -> None:
        uris = (node.get("refuri", "") for node in tree.findall(nodes.reference))
        found.update(uri for uri in uris if uri.startswith(("http://", "https://")))

    def write(app: Sphinx, error: Exception | None) -> None:
        if error is None:
            text = "".join(f"{uri}\n" for uri in sorted(found))
            (Path(app.outdir) / "external-links.txt").write_text(text, encoding="utf-8")

    app.connect("doctree-resolved", collect)
    app.connect("build-finished", write)
    return {"parallel_read_safe": True, "parallel_write_safe": False}
