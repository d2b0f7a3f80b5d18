"""Docstrings write a length as |a|, which reStructuredText takes for a substitution."""

from __future__ import annotations

from sphinx.application import Sphinx


def _escape(_app: Sphinx, _what: str, _name: str, _object: object, _options: object,
            lines: list[str]) -> None:  # fmt: skip
    lines[:] = [line.replace("|", "\\|") for line in lines]


def setup(app: Sphinx) -> dict[str, bool]:
    """Escape bars, after numpydoc (500) has arranged the docstring."""
    app.connect("autodoc-process-docstring", _escape, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
