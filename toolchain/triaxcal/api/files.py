"""`write_first_file`, `key_schema`, `copy_example`: files to begin with, and their schemas."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import FileKeys
from triaxcal.base.tomltable import did_you_mean
from triaxcal.keytable.catalogue import FILES
from triaxcal.keytable.schema import json_schema
from triaxcal.keytable.starter import write_starter
from triaxcal.unit.examples import ExampleUnit, example_units, write_example


def write_first_file(folder: str | Path, kind: str = "tilter") -> tuple[Path, Path]:
    """Write a first, commented file of a kind and its JSON Schema into a folder; none is replaced.

    Parameters
    ----------
    folder : path
        Of a unit, whose serial number becomes the folder's name; it is made where it is missing.
    kind : str
        "tilter", "recording", "imu", "rig" and so on, as `triaxcal init --help` lists them.

    Returns
    -------
    tuple of two paths
        The file and its schema.

    Raises
    ------
    RefusedError
        When there is no such kind, or one of the files exists already.
    """
    _keys(kind)
    return write_starter(Path(folder), kind)


def examples() -> tuple[ExampleUnit, ...]:
    """The example units that came with this triaxcal: name, description, the commands to try."""
    return tuple(example_units())


def copy_example(name: str, into: str | Path = ".") -> Path:
    """Copy an example unit into a folder; nothing is replaced.

    Parameters
    ----------
    name : str
        As `examples` gives it: "AT-SIM".
    into : path
        Receives a folder of that name.

    Returns
    -------
    path
        The unit's folder.

    Raises
    ------
    RefusedError
        When there is no such example, or something of its name is there already.
    """
    return write_example(name, Path(into))


def key_schema(kind: str) -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a kind of TOML file.

    Raises
    ------
    RefusedError
        When there is no such kind.
    """
    return json_schema(_keys(kind))


def _keys(kind: str) -> FileKeys:
    if kind not in FILES:
        raise RefusedError(
            "kind", f"found {kind!r}{did_you_mean(kind, FILES)}", expected=", ".join(FILES)
        )
    return FILES[kind]()
