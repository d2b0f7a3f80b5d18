"""HTML pages: their templates, in which every value is escaped."""

from __future__ import annotations

from functools import cache
from typing import Any

import jinja2

from triaxcal.codegen.templates import environment


@cache
def _pages() -> jinja2.Environment:
    """The environment of the other templates, with values escaped.

    Compiled templates are kept apart: by its names jinja2 would take those that do not escape.
    """
    cache_of_pages: jinja2.BytecodeCache | None
    try:
        cache_of_pages = jinja2.FileSystemBytecodeCache(pattern="__jinja2_pages_%s.cache")
    except (OSError, RuntimeError):  # no folder that is ours alone
        cache_of_pages = None
    return environment().overlay(autoescape=True, bytecode_cache=cache_of_pages)


def page(template: str, **context: Any) -> bytes:
    """A page of templates/pages; what is no `Markup` is escaped.

    Names of folders may be no text: their bytes stand as numbers on the page.
    """
    made = _pages().get_template(f"pages/{template}").render(context)
    return made.encode("utf-8", "backslashreplace")


def css_text(text: str) -> str:
    """`text` within quotes in a style sheet: everything but letters and digits by its number.

    The space behind a number ends it and is not shown.
    """
    return "".join(
        c if (c.isalnum() and c.isascii()) or c in " -_." else f"\\{ord(c):x} " for c in text
    )
