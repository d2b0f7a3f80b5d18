"""JSON Schemas of the TOML files: editors that know them complete keys and mark mistakes."""

from __future__ import annotations

from typing import Any

from triaxcal.base.keys import FileKeys, Key, TableKeys
from triaxcal.keytable.reference import default_words


def json_schema(file: FileKeys) -> dict[str, Any]:
    """Schema of a file, draft 2020-12.

    It checks names, types and ranges of keys. What depends on several keys, only triaxcal checks.
    """
    top, *tables = file.tables
    schema = _table(top)
    schema["properties"] |= {table.name: _tables(table) for table in tables}
    schema["required"] += [
        table.name
        for table in tables
        if not table.optional and any(key.required for key in table.keys)
    ]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"{file.name}: {file.title[0].lower()}{file.title[1:]}",
        **schema,
    }


def _tables(table: TableKeys) -> dict[str, Any]:
    """Schema of a table, or of several."""
    if table.many:
        return {"type": "array", "items": _table(table)}
    if not table.each:
        return _table(table)
    return {"type": "object", "additionalProperties": _table(table)}


def _table(table: TableKeys) -> dict[str, Any]:
    return {
        "type": "object",
        "description": table.doc,
        "properties": {key.name: _key(key) for key in table.keys},
        "required": [key.name for key in table.keys if key.required],
        "additionalProperties": False,
    }


def _key(key: Key[Any]) -> dict[str, Any]:
    unit = f" Unit: {key.unit}." if key.unit else ""
    default = "" if key.required else f" Default: {default_words(key)}."
    return {"description": f"{key.doc}{unit}{default}", **key.kind.schema}
