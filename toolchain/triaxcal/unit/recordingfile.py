"""How the file of a recording is written, and what a column of it is, in any table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path, PureWindowsPath
from types import MappingProxyType

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import Values, setting
from triaxcal.base.kinds import FLAG, TEXT, Kind, checked, listed, meaning, whole, word

DELIMITERS: Mapping[str, str] = MappingProxyType(
    {"comma": ",", "semicolon": ";", "tab": "\t", "pipe": "|", "space": " "}
)

ISO = "iso"
TIME_UNITS: Mapping[str, float] = MappingProxyType(
    {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, ISO: 1.0}
)

CAN_LOG = "can"
"""Format of a log of CAN frames, whose columns a bus description gives."""
TEMPERATURE_UNITS = ("degC", "K", "degF", "code")

Column = str | int
"""Name in the file, or number from 1."""


@dataclass(frozen=True)
class SignedColumn:
    """A column, and the sign that its readings are given."""

    column: Column
    sign: int


def is_in_folder(name: object) -> bool:
    """Whether the name of a file stays in the unit's folder."""
    return (
        isinstance(name, str)
        and bool(name)
        and not name.startswith(("/", "\\"))
        and not PureWindowsPath(name).is_absolute()
        and ".." not in name.replace("\\", "/").split("/")
    )


def files_in(folder: Path, names: Sequence[str]) -> tuple[Path, ...]:
    """Files of those names, in their order; what a pattern stands for, by name.

    A pattern that no file fits, and a file that is absent, stay as they are: reading them tells so.
    """
    found: list[Path] = []
    for name in names:
        path = folder / name
        fitting = [] if path.exists() or not set("*?") & set(name) else sorted(folder.glob(name))
        found += [f for f in fitting or [path] if f not in found]
    return tuple(found)


def _column(value: object) -> Column:
    named = isinstance(value, str) and value != ""
    numbered = isinstance(value, int) and not isinstance(value, bool) and value >= 1
    if not (named or numbered):
        raise ValueError
    return value  # type: ignore[return-value]  # what `named` and `numbered` say


def _signed_column(value: object) -> SignedColumn:
    """Column; a minus before its name or number turns the sign of its readings."""
    negative = value < 0 if isinstance(value, int) else str(value).startswith("-")
    bare = -value if negative and isinstance(value, int) else value
    bare = bare.removeprefix("-") if isinstance(bare, str) else bare
    return SignedColumn(_column(bare), -1 if negative else 1)


def _three_signed(value: object) -> tuple[SignedColumn, ...]:
    found = tuple(map(_signed_column, value)) if isinstance(value, list) else ()
    if len(found) != 3 or len({c.column for c in found}) != 3:
        raise ValueError
    return found


FILE: Kind[str] = checked(
    is_in_folder,
    "a file in the unit's folder",
    {"type": "string"},
    '"recording.csv"',
    "copy it there",
)
_FILES = listed(FILE, range(1, 1001), "", different=True)
FILES: Kind[tuple[str, ...]] = Kind(
    "a file in the unit's folder, or a list of different files there, * standing for any text",
    lambda value: _FILES.parse(value if isinstance(value, list) else [value]),
    {"anyOf": [FILE.schema, _FILES.schema]},
    "copy it there",
    example='"recording.csv"',
)
_SCHEMA = {"anyOf": [{"type": "string", "minLength": 1}, {"type": "integer"}]}
COLUMN = Kind("the name of a column, or its number from 1", _column, _SCHEMA, example='"column"')
_TIMES = listed(COLUMN, range(1, 5), "", different=True)
TIMES: Kind[tuple[Column, ...]] = Kind(
    "a column by name or number, or a list of up to four",
    lambda value: _TIMES.parse(value if isinstance(value, list) else [value]),
    {"anyOf": [_SCHEMA, _TIMES.schema]},
    example='"time"',
)
_UNIT = word(tuple(TIME_UNITS))
STAMPS: Kind[tuple[str, ...]] = Kind(
    _UNIT.expected + ", or a list with one for each column",
    lambda value: tuple(map(_UNIT.parse, value if isinstance(value, list) else [value])),
    {"anyOf": [_UNIT.schema, {"type": "array", "items": _UNIT.schema}]},
    choices=_UNIT.choices,
    example='"s"',
)
COLUMNS = listed(
    COLUMN, range(3, 4), "a list of 3 different columns, by name or number", different=True
)
SIGNED_COLUMNS = Kind(
    'three different columns, by name or number, as ["ax", "-ay", "az"]',
    _three_signed,
    {"type": "array", "items": _SCHEMA, "minItems": 3, "maxItems": 3},
    example='["ax", "ay", "az"]',
)


@dataclass(frozen=True, kw_only=True)
class WrittenFile:
    """How a file is written.

    Attributes
    ----------
    format
        Format of the file, by its name.
    variable
        Matrix, sheet, topic or group of a file that holds several.
    delimiter
        What separates the cells of text; "space" is any white space.
    header
        Whether the first line of text names the columns.
    skip_rows
        Lines above the header or the first row. What a logger writes there is found without it.
    comment
        Lines of text that begin with it are ignored.
    decimal
        Decimal sign of text.
    dbc
        Bus description (DBC, KCD, SYM, ARXML) of a log of CAN frames, beside it; columns are then
        signals, as "Message.Signal".
    rig
        Rig description (rig.toml) of such a log, in place of dbc; columns are then x, y, z and
        temperature, or x_code and so on.
    """

    format: str | None = setting(TEXT, None, words="found by the content")
    variable: str | None = setting(TEXT, None, words="the only one")
    delimiter: str | None = setting(meaning(DELIMITERS), None, words="found from the file")
    header: bool | None = setting(FLAG, None, words="found from the file")
    skip_rows: int = setting(whole(0, 10**6), 0, "lines")
    comment: str = setting(TEXT, "#")
    decimal: str = setting(word((".", ",")), ".")
    dbc: str | None = setting(FILE, None, example='"imu.dbc"')
    rig: str | None = setting(FILE, None, example='"rig.toml"')

    def layout(self, table: str, columns: Sequence[Column]) -> FileLayout:
        """Layout of the file of `table`, of which `columns` will be asked for."""
        written = {f.name: getattr(self, f.name) for f in fields(WrittenFile)}
        if (self.dbc, self.rig) != (None, None) and self.format is None:
            written["format"] = CAN_LOG
        return FileLayout(table, tuple(columns), **written)


@dataclass(frozen=True)
class FileLayout(WrittenFile):
    """How a file is written, for its reader.

    Attributes
    ----------
    table : str
        Name of the table that says it, "recording" or "dynamic", for messages.
    wanted : tuple of Column
        Columns that will be asked for: their names distinguish a header from a remark.
    """

    table: str
    wanted: tuple[Column, ...] = ()


def check_units(values: Values, time: Sequence[Column], units: Sequence[str]) -> None:
    """Refuse `time_unit` with another number of units than there are columns of time."""
    if len(units) not in {1, max(len(time), 1)}:
        raise RefusedError(
            values.where("time_unit"),
            f"{len(units)} units for {len(time)} columns of time",
            expected="one unit, or one for each column",
        )


@dataclass(frozen=True)
class ClockLayout:
    """Where the times of the rows are.

    Attributes
    ----------
    columns : tuple of Column
        Times that are added up, as seconds and nanoseconds, or a date and a time of day; empty
        where the rows are evenly spaced.
    units : tuple of str
        Of `TIME_UNITS`: one for all columns, or one each.
    rate_hz : float or None
        Of rows that are evenly spaced.
    from_first : bool
        Whether time starts with the first row, so that large stamps keep all their digits.
    absent : RefusedError or None
        Raised where neither is given and the file has no clock of its own; None where none is
        needed.
    """

    columns: tuple[Column, ...]
    units: tuple[str, ...]
    rate_hz: float | None = None
    from_first: bool = True
    absent: RefusedError | None = None

    @property
    def unit_of(self) -> tuple[str, ...]:
        """Unit of each column."""
        return self.units * (len(self.columns) if len(self.units) == 1 else 1)
