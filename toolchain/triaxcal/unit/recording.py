"""[recording] in unit.toml: what the columns of somebody's recording are.

A recording is rows of samples, in which the poses have to be found, or rows of poses, each the
mean of one, or sections: stretches of samples with one label, each a pose. Presets name the layouts
of published recordings; keys of the table override them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from types import MappingProxyType

from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import Table, shown

SAMPLES, POSES, SECTIONS = "samples", "poses", "sections"
ACCELERATION_UNITS: Mapping[str, float | None] = MappingProxyType(
    {"m/s^2": 9.80665, "g": 1.0, "mg": 1e3, "count": None, "V": None, "mV": None}
)
"""Readings of 1 g, where the unit says it."""
DEFAULT_LSB: Mapping[str, float] = MappingProxyType(
    {"m/s^2": 2.0**-16, "g": 2.0**-20, "mg": 2.0**-10, "count": 1.0, "V": 2.0**-22, "mV": 2.0**-12}
)
"""Reading of one raw code where [adc] says nothing: at 24 bits +-128 m/s^2, +-8 g, +-2 V."""
TIME_UNITS: Mapping[str, float] = MappingProxyType(
    {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "iso": 1.0}
)
TEMPERATURE_UNITS = ("degC", "K", "degF", "code")
DELIMITERS: Mapping[str, str] = MappingProxyType(
    {"comma": ",", "semicolon": ";", "tab": "\t", "space": " "}
)
AIRCRAFT, INCLINOMETER = "aircraft", "inclinometer"
ANGLE_NAMES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {AIRCRAFT: ("pitch", "roll", "yaw"), INCLINOMETER: ("zenith", "tool_face", "azimuth")}
)
"""The two angles that gravity sees, then the one that it does not."""
FACES = ("+x", "-x", "+y", "-y", "+z", "-z")
STILL_S = 2.0
"""Shortest pose by itself: 200 samples at 100 Hz, 0.07 of their noise."""

KEYS = (
    "file", "preset", "rows", "delimiter", "header", "skip_rows", "comment", "decimal", "variable",
    "acceleration", "acceleration_unit", "time", "time_unit", "sample_rate_hz", "gyro",
    "temperature", "temperature_unit", "section", "faces", "angle_unit", "still_s", "frame",
    *(name for names in ANGLE_NAMES.values() for name in names),
)  # fmt: skip

PRESETS: Mapping[str, Mapping[str, object]] = MappingProxyType(
    {
        "mikoff-mpu9150": {
            "acceleration": [1, 2, 3],
            "acceleration_unit": "m/s^2",
            "gyro": [4, 5, 6],
            "sample_rate_hz": 100,
        },
        "imucal-annotated": {
            "acceleration": ["acc_x", "acc_y", "acc_z"],
            "acceleration_unit": "count",
            "sample_rate_hz": 100,
            "section": "part",
            "faces": {"x_p": "+x", "x_a": "-x", "y_p": "+y", "y_a": "-y", "z_p": "+z", "z_a": "-z"},
        },
        "imucal-session": {
            "acceleration": ["acc_x", "acc_y", "acc_z"],
            "acceleration_unit": "m/s^2",
            "gyro": ["gyr_x", "gyr_y", "gyr_z"],
            "sample_rate_hz": Decimal("102.4"),
        },
        "tofupilot-thermal": {
            "acceleration": ["imu.acc.x", "imu.acc.y", "imu.acc.z"],
            "acceleration_unit": "m/s^2",
            "time": "timestamp",
            "time_unit": "us",
            "temperature": "imu.temperature",
        },
        "imu-tk": {
            "time": 1,
            "time_unit": "s",
            "acceleration": [2, 3, 4],
            "acceleration_unit": "count",
        },
    }
)

Column = str | int
"""Name in the header, or number from 1."""


@dataclass(frozen=True)
class SignedColumn:
    """A column, and the sign that its readings are given."""

    column: Column
    sign: int


@dataclass(frozen=True)
class Angles:
    """Columns of the angles of rows of poses.

    Attributes
    ----------
    kind : str
        "aircraft" (pitch, roll, yaw) or "inclinometer" (zenith, tool face, azimuth).
    columns : tuple of two or three Column
        In the order of `ANGLE_NAMES`; the third may be missing.
    unit : str
        "deg" or "rad".
    """

    kind: str
    columns: tuple[Column, ...]
    unit: str


@dataclass(frozen=True)
class RecordingLayout:
    """What a recording's file is, validated; absent optional columns are None.

    Attributes
    ----------
    file : str
        Name of the file, in the unit's folder or below it.
    rows : str
        "samples", "poses" or "sections".
    delimiter : str or None
        None finds it.
    header : bool or None
        None finds out.
    acceleration : tuple of three SignedColumn
    faces : mapping
        Label of the section column to the axis that points up, as "+x".
    frame : str
        "sensor" or "case": `fit.family.frame`.
    """

    file: str
    rows: str
    delimiter: str | None
    header: bool | None
    skip_rows: int
    comment: str
    decimal: str
    variable: str | None
    acceleration: tuple[SignedColumn, SignedColumn, SignedColumn]
    acceleration_unit: str
    time: Column | None
    time_unit: str
    sample_rate_hz: float | None
    gyro: tuple[Column, ...] | None
    temperature: Column | None
    temperature_unit: str
    section: Column | None
    faces: Mapping[str, str]
    angles: Angles | None
    still_s: float
    frame: str

    @property
    def reading_of_1_g(self) -> float | None:
        """Reading that 1 g should give, where the unit says it."""
        return ACCELERATION_UNITS[self.acceleration_unit]


def recording_layout(table: Table) -> RecordingLayout | None:
    """Layout in a table [recording]; None when there is none.

    Raises
    ------
    RefusedError
        For a value that is none of those in docs/recordings.md, and for keys that contradict each
        other.
    """
    if not table.values:
        return None
    if "file" not in table:
        raise RefusedError(
            table.where("file"), "missing", expected="the name of the recording's file"
        )
    name = table.choice("preset", tuple(PRESETS)) if "preset" in table else None
    preset = PRESETS[name] if name else {}
    merged = Table(table.file, table.name, {**preset, **table.values})
    if "acceleration" not in merged or "acceleration_unit" not in merged:
        key = "acceleration" if "acceleration" not in merged else "acceleration_unit"
        raise RefusedError(
            table.where(key),
            "missing",
            expected='the three columns, as ["ax", "ay", "az"]'
            if key == "acceleration"
            else "one of " + ", ".join(f'"{u}"' for u in ACCELERATION_UNITS),
            remedy="or name a preset: " + ", ".join(PRESETS),
        )
    return _layout(merged)


def _layout(table: Table) -> RecordingLayout:
    rows = _word(table, "rows", (SAMPLES, POSES, SECTIONS))
    angles = _angles(table)
    time = _column(table, "time") if "time" in table else None
    rate = table.number("sample_rate_hz", 1e-3, 1e6) if "sample_rate_hz" in table else None
    if rows == SAMPLES and "faces" not in table and time is None and rate is None:
        raise RefusedError(
            table.where("time"), "missing", expected="a time column, or sample_rate_hz"
        )
    if rows == SECTIONS and "section" not in table:
        raise RefusedError(
            table.where("section"), "missing", expected="the column that numbers or names the poses"
        )
    if angles is not None and rows == SAMPLES:
        raise RefusedError(
            table.where(ANGLE_NAMES[angles.kind][0]),
            "angles with rows of samples",
            expected='rows = "poses", one row a pose, or "sections"',
        )
    section = _column(table, "section") if "section" in table else None
    if "faces" in table and section is None:
        raise RefusedError(table.where("faces"), "given without section", expected="its column")
    return RecordingLayout(
        file=_file(table),
        rows=rows,
        delimiter=DELIMITERS[table.choice("delimiter", tuple(DELIMITERS))]
        if "delimiter" in table
        else None,
        header=_flag(table, "header"),
        skip_rows=table.integer("skip_rows", 0, 10**6) if "skip_rows" in table else 0,
        comment=table.text("comment") if "comment" in table else "#",
        decimal=_word(table, "decimal", (".", ",")),
        variable=table.text("variable") if "variable" in table else None,
        acceleration=_acceleration(table),
        acceleration_unit=table.choice("acceleration_unit", tuple(ACCELERATION_UNITS)),
        time=time,
        time_unit=_word(table, "time_unit", tuple(TIME_UNITS)),
        # A time column says more than a rate; a preset's rate yields to it.
        sample_rate_hz=None if time is not None else rate,
        gyro=_columns(table, "gyro", range(3, 4)) if "gyro" in table else None,
        temperature=_column(table, "temperature") if "temperature" in table else None,
        temperature_unit=_word(table, "temperature_unit", TEMPERATURE_UNITS),
        section=section,
        faces=_faces(table),
        angles=angles,
        still_s=table.number("still_s", 1e-3, 1e5) if "still_s" in table else STILL_S,
        frame=_word(table, "frame", ("sensor", "case")),
    )


def _word(table: Table, key: str, words: tuple[str, ...]) -> str:
    return table.choice(key, words) if key in table else words[0]


def is_in_folder(name: str) -> bool:
    """Whether the name of a recording stays in the unit's folder."""
    return (
        bool(name) and not name.startswith("/") and ".." not in name.replace("\\", "/").split("/")
    )


def _file(table: Table) -> str:
    name = table.text("file")
    if not is_in_folder(name):
        raise table.refuse("file", "a file in the unit's folder", "copy it there")
    return name


def _flag(table: Table, key: str) -> bool | None:
    if key not in table:
        return None
    value = table.values[key]
    if not isinstance(value, bool):
        raise table.refuse(key, "true or false")
    return value


def _is_column(value: object) -> bool:
    if isinstance(value, bool):
        return False
    return (isinstance(value, int) and value >= 1) or (isinstance(value, str) and value != "")


def _column(table: Table, key: str) -> Column:
    value = table.values[key]
    if not _is_column(value):
        raise table.refuse(key, "the name of a column, or its number from 1")
    assert isinstance(value, str | int)
    return value


def _columns(table: Table, key: str, lengths: range) -> tuple[Column, ...]:
    value = table.values[key]
    if (
        not isinstance(value, list)
        or len(value) not in lengths
        or not all(map(_is_column, value))
        or len(set(value)) != len(value)
    ):
        raise table.refuse(key, f"a list of {lengths[0]} different columns, by name or number")
    return tuple(value)


def _acceleration(table: Table) -> tuple[SignedColumn, SignedColumn, SignedColumn]:
    """Three columns; a minus before a name or number turns the sign of its readings."""
    value = table.values["acceleration"]
    expected = 'three different columns, by name or number, as ["ax", "-ay", "az"]'
    if not isinstance(value, list) or len(value) != 3:
        raise table.refuse("acceleration", expected)
    found = []
    for item in value:
        bare = item.removeprefix("-") if isinstance(item, str) else item
        if isinstance(item, int) and not isinstance(item, bool):
            bare = abs(item)
        if not _is_column(bare):
            raise table.refuse("acceleration", expected)
        found.append(SignedColumn(bare, 1 if bare == item else -1))
    if len({c.column for c in found}) != 3:
        raise table.refuse("acceleration", expected)
    return (found[0], found[1], found[2])


def _faces(table: Table) -> Mapping[str, str]:
    if "faces" not in table:
        return {}
    value = table.values["faces"]
    if not isinstance(value, dict) or not all(face in FACES for face in value.values()):
        raise RefusedError(
            table.where("faces"),
            f"found {shown(value)}",
            expected='a label and the axis that points up each, as {top = "+z", bottom = "-z"}',
        )
    return {str(label): str(face) for label, face in value.items()}


def _angles(table: Table) -> Angles | None:
    kinds = [k for k, names in ANGLE_NAMES.items() if any(name in table for name in names)]
    if not kinds:
        return None
    if len(kinds) == 2:
        raise RefusedError(
            table.where("pitch"),
            "aircraft and inclinometer angles together",
            expected="pitch and roll, or zenith and tool_face",
        )
    names = ANGLE_NAMES[kinds[0]]
    missing = [name for name in names[:2] if name not in table]
    if missing:
        raise RefusedError(table.where(missing[0]), "missing", expected=" and ".join(names[:2]))
    if "angle_unit" not in table:
        raise RefusedError(table.where("angle_unit"), "missing", expected='"deg" or "rad"')
    columns = tuple(_column(table, name) for name in names if name in table)
    return Angles(kinds[0], columns, table.choice("angle_unit", ("deg", "rad")))
