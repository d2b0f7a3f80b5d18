"""The reference of the keys as Markdown.

The documentation includes it with the directive `keys` of docs/_ext/generated.py: a block
`{keys} tilter` becomes `reference_markdown(FILES["tilter"]())`.
"""

from __future__ import annotations

from typing import Any

from triaxcal.base.keys import FileKeys, Key, TableKeys
from triaxcal.base.tomltext import toml_value

HEAD = "| key | type and range | unit | default | meaning |\n|---|---|---|---|---|"


def reference_markdown(file: FileKeys) -> str:
    """A table of keys for each table of a file."""
    return "\n\n".join(_table(table) for table in file.tables)


def _table(table: TableKeys) -> str:
    title = f"**`{table.header}`**" if table.name else "**The top of the file**"
    optional = " The table may be left out." if table.optional else ""
    rows = "\n".join(_row(key) for key in table.keys)
    return f"{title} {table.doc}{optional}\n\n{HEAD}\n{rows}".replace(" \n", "\n")


def _row(key: Key[Any]) -> str:
    cells = (f"`{key.name}`", key.kind.expected, key.unit, default_words(key), key.doc)
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def default_words(key: Key[Any]) -> str:
    """What an absent key means, in words."""
    if key.required:
        return "required"
    return key.default_words or (
        toml_value(key.default) if key.default not in (None, "") else "none"
    )
