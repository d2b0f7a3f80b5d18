"""docs/explanation/reading-the-c.md quotes the C that is delivered for AT-CHERNIAK, all of it."""

from __future__ import annotations

import re
import sys
from pathlib import Path

DOCS = Path(__file__).parent.parent / "docs"
sys.path.insert(0, str(DOCS / "_ext"))

import generated  # noqa: E402

PAGE = (DOCS / "explanation" / "reading-the-c.md").read_text(encoding="utf-8")


def joined(text: str) -> str:
    """Without comments and with one blank where there is any space."""
    return " ".join(re.sub(r"/\*.*?\*/", " ", text, flags=re.DOTALL).split())


def explained(page: str) -> list[tuple[str, str]]:
    """Function blocks of a page with the line of code that each item below begins with."""
    found, block = [], ""
    for line in page.splitlines():
        if match := re.fullmatch(r"<!-- generated: function (.+) -->", line):
            block = match[1]
        if match := re.match(r"- `([^`]+)`: ", line):
            found.append((block, match[1]))
    return found


def test_every_function_of_the_file_is_on_the_page_in_its_order() -> None:
    shown = re.findall(r"^<!-- generated: function (.+) -->$", PAGE, re.MULTILINE)
    assert " ".join(shown).split() == list(generated.functions_of(generated.delivered_c()))


def test_every_line_that_is_explained_is_in_the_function_above() -> None:
    functions = generated.functions_of(generated.delivered_c())
    items = explained(PAGE)
    assert len(items) > 30
    for names, quoted in items:
        code = joined(" ".join(functions[name] for name in names.split()))
        assert joined(quoted) in code, f"{names}: {quoted}"


def test_what_stands_between_the_functions_is_declarations_alone() -> None:
    """So that nothing of the file is left out."""
    rest = generated.delivered_c()
    for body in generated.functions_of(rest).values():
        rest = rest.replace(body, "")
    lines = [line for line in joined_lines(rest) if line]
    assert all(line.startswith(("#include", "#define")) for line in lines), lines


def joined_lines(text: str) -> list[str]:
    return [
        " ".join(line.split())
        for line in re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL).splitlines()
    ]


def test_a_line_that_the_c_does_not_have_is_found() -> None:
    page = PAGE.replace("int32_t ux = raw_code[0];", "int32_t ux = raw_code[1];")
    functions = generated.functions_of(generated.delivered_c())
    wrong = [q for n, q in explained(page) if joined(q) not in joined(functions[n.split()[-1]])]
    assert "int32_t ux = raw_code[1];" in wrong
