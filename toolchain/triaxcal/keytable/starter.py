"""A first version of a TOML file: required keys with examples, the others commented out."""

from __future__ import annotations

import json
import textwrap
import tomllib
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from typing import Any

from triaxcal.base.errors import RefusedError, refused_by_system
from triaxcal.base.keys import REQUIRED, FileKeys, Key, TableKeys
from triaxcal.base.tomltext import toml_value
from triaxcal.keytable.catalogue import FILES
from triaxcal.keytable.reference import default_words
from triaxcal.keytable.schema import json_schema
from triaxcal.unit.folder import UNIT_FILE, check_unit_name

_WIDTH = 96


def starter_text(file: FileKeys, schema: str = "") -> str:
    """Text of a file that is read as it stands.

    Parameters
    ----------
    schema : str
        Name of the file's JSON Schema beside it, for editors; "" for none.
    """
    head = f"#:schema ./{schema}\n" if schema else ""
    head += _comment(
        f"{file.title}. Replace the examples. A key that is commented out has the default that its "
        "comment names; its value here is that default, unless the comment says that it is an "
        "example."
    )
    return head + "".join(_table(table, file.first) for table in file.tables)


def write_starter(folder: Path, kind: str) -> tuple[Path, Path]:
    """Write a first file of a kind, a key of `FILES`, and its JSON Schema; returns both paths.

    A unit's serial number is the name of its folder.

    Raises
    ------
    RefusedError
        When one of the files exists already, or the folder's name is unfit for a unit.
    """
    file = FILES[kind]()
    path = folder / file.name
    schema = path.with_suffix(".schema.json")
    if file.name == UNIT_FILE:
        check_unit_name(folder.absolute().name)
        serial = {"serial": {"example": toml_value(folder.absolute().name)}}
        file = replace(file, tables=(file.tables[0].but(**serial), *file.tables[1:]))
    for there in (path, schema):
        if there.exists():
            raise RefusedError(
                str(there), "exists already", remedy="edit it, remove it, or name another folder"
            )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        path.write_text(starter_text(file, schema.name), encoding="utf-8")
        schema.write_text(json.dumps(json_schema(file), indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise refused_by_system(folder, "written", error) from error
    return path, schema


def _table(table: TableKeys, first: tuple[str, ...]) -> str:
    stand = [] if table.optional else [k for k in table.keys if k.required or k.name in first]
    head = f"\n{_comment(table.doc)}" if table.name else ""
    if table.name:
        head += f"{'' if stand else '# '}{table.header}\n"
    return head + "".join(_key(key, key in stand) for key in table.keys)


def _key(key: Key[Any], stands: bool) -> str:
    expected, unit = key.kind.expected, f", {key.unit}" if key.unit else ""
    more = f" Default: {default_words(key)}."
    more += "" if stands or _is_default(key) else " The value is an example."
    if key.required:
        more = "" if stands else " Required in this table."
    about = _comment(f"{key.doc} {expected[0].upper()}{expected[1:]}{unit}.{more}")
    return f"\n{about}{'' if stands else '# '}{key.name} = {example(key)}\n"


def example(key: Key[Any]) -> str:
    """A good value in TOML: the default, if there is one."""
    stated = key.default not in (REQUIRED, None, (), {})
    if stated and (not key.kind.choices or key.default in key.kind.choices):
        return key.example or toml_value(key.default)
    return key.example or key.kind.example


def _is_default(key: Key[Any]) -> bool:
    """Whether the example says what an absent key says."""
    found = tomllib.loads(f"value = {example(key)}", parse_float=Decimal)["value"]
    return bool(key.kind.parse(found) == key.default)


def _comment(text: str) -> str:
    lines = textwrap.wrap(text, _WIDTH, break_on_hyphens=False)
    return "".join(f"# {line}\n" for line in lines)
