"""How the file of a recording is written, whatever its columns mean."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

DELIMITERS: Mapping[str, str] = MappingProxyType(
    {"comma": ",", "semicolon": ";", "tab": "\t", "space": " "}
)

Column = str | int
"""Name in the file, or number from 1."""


@dataclass(frozen=True)
class FileLayout:
    """How a file is written, as far as a table of unit.toml says it.

    Attributes
    ----------
    table : str
        Name of that table, "recording" or "dynamic", for messages.
    format : str or None
        Name of a format; None finds it from the content.
    variable : str or None
        Matrix, sheet, topic or group of a file that holds several.
    delimiter, header, skip_rows, comment, decimal
        Of text; None finds delimiter and header.
    wanted : tuple of str
        Names of columns that will be asked for: they tell a header from a remark.
    """

    table: str
    format: str | None = None
    variable: str | None = None
    delimiter: str | None = None
    header: bool | None = None
    skip_rows: int = 0
    comment: str = "#"
    decimal: str = "."
    wanted: tuple[str, ...] = ()
