"""[recording] in unit.toml: what the columns of somebody's recording are.

A recording is rows of samples, in which the poses have to be found, or rows of poses, each the
mean of one, or sections: stretches of samples with one label, each a pose. Presets name the layouts
of published recordings; keys of the table override them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import FileKeys, TableKeys, Values, setting
from triaxcal.base.kinds import Kind, number, word
from triaxcal.base.tomltable import read_toml
from triaxcal.unit.presets import PRESETS
from triaxcal.unit.recordingfile import (
    COLUMN,
    COLUMNS,
    FILES,
    SIGNED_COLUMNS,
    STAMPS,
    TEMPERATURE_UNITS,
    TIMES,
    ClockLayout,
    Column,
    FileLayout,
    SignedColumn,
    WrittenFile,
    check_units,
)

SAMPLES, POSES, SECTIONS = "samples", "poses", "sections"
ACCELERATION_UNITS: Mapping[str, float | None] = MappingProxyType(
    {"m/s^2": 9.80665, "g": 1.0, "mg": 1e3, "count": None, "V": None, "mV": None}
)
"""Readings of 1 g, if the unit states it."""
AIRCRAFT, INCLINOMETER = "aircraft", "inclinometer"
ANGLE_NAMES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {AIRCRAFT: ("pitch", "roll", "yaw"), INCLINOMETER: ("zenith", "tool_face", "azimuth")}
)
"""The two angles that gravity sees, then the one that it does not."""
FACES = ("+x", "-x", "+y", "-y", "+z", "-z")
STILL_S = 0.5
"""Shortest pose by default: a hand that turns back stands still for less."""


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
    vectors : bool
        Whether the columns are those of `direction`, turned into angles where they are read.
    """

    kind: str
    columns: tuple[Column, ...]
    unit: str
    vectors: bool = False


def _faces(value: object) -> Mapping[str, str]:
    if not isinstance(value, dict) or not all(face in FACES for face in value.values()):
        raise ValueError
    return {str(label): str(face) for label, face in value.items()}


LABELLED_FACES = Kind(
    'a label and the axis that points up each, as {top = "+z", bottom = "-z"}',
    _faces,
    {"type": "object", "additionalProperties": {"enum": list(FACES)}},
    example='{top = "+z", bottom = "-z"}',
)


@dataclass(frozen=True, kw_only=True)
class _RecordedFile:
    """The file and its rows.

    Attributes
    ----------
    file
        File of the recording, in the unit's folder or below it; a list, or a pattern as "day*.csv",
        is one recording in several files.
    preset
        Layout of a published recording; other keys override it.
    rows
        What a row is. "sections": a sample, and each stretch with one label is a pose.
    """

    file: tuple[str, ...] = setting(FILES)
    preset: str | None = setting(word(tuple(PRESETS)), None)
    rows: str = setting(word((SAMPLES, POSES, SECTIONS)), SAMPLES)


@dataclass(frozen=True, kw_only=True)
class RecordingLayout(WrittenFile, _RecordedFile):
    """[recording]: a recording of samples or poses. A unit with it has no measurements.csv.

    Absent optional columns are None.

    Attributes
    ----------
    acceleration
        Readings of x, y, z, by name or number from 1; "-ay" or -2 turns the sign.
    acceleration_unit
        Unit of the readings.
    time
        Time of each row; a list is added up, as ["sec", "nanosec"], or put together, as
        ["date", "time"].
    time_unit
        Unit of `time`, or a list of them; "iso" is 2026-03-30T12:00:00.25, 12:00:00.25 or, of
        two columns, a date and a time of day.
    sample_rate_hz
        Rate of even samples, in place of `time`.
    gyro
        Rates of x, y, z in any unit: they show stillness and left-handed axes.
    temperature
        Temperature of each row.
    temperature_unit
        Unit of `temperature`; codes are those of `[temperature_sensor]`.
    section
        Label of each row; required with `rows = "sections"`.
    faces
        Labels in the column `section`, and the axis that points up in each.
    angle_unit
        Unit of the angles.
    direction
        Upward direction of each pose on x, y, z, unit vectors, with `rows = "poses"` or
        "sections"; in place of angles.
    still_s
        Shortest pose.
    frame
        Axes of the result where orientations are unknown.
    pitch
        Aircraft angle of each pose, with `rows = "poses"` or "sections".
    roll
        The second aircraft angle.
    yaw
        Does not change gravity; shows a table that is not level.
    zenith
        Inclinometer angle of each pose.
    tool_face
        The second inclinometer angle.
    azimuth
        As `yaw`.
    table
        Of unit.toml, for messages.
    """

    acceleration: tuple[SignedColumn, ...] = setting(
        SIGNED_COLUMNS,
        (),
        words="of the preset; required without one",
        example='["ax", "ay", "az"]',
    )
    acceleration_unit: str = setting(
        word(tuple(ACCELERATION_UNITS)),
        "",
        words="of the preset; required without one",
        example='"m/s^2"',
    )
    time: tuple[Column, ...] = setting(TIMES, (), words="none", example='"time"')
    time_unit: tuple[str, ...] = setting(STAMPS, ("s",), words='`"s"`', example='"s"')
    sample_rate_hz: float | None = setting(number(1e-3, 1e6), None, "Hz", example="100")
    gyro: tuple[Column, ...] | None = setting(COLUMNS, None, example='["gx", "gy", "gz"]')
    temperature: Column | None = setting(COLUMN, None, example='"temperature"')
    temperature_unit: str = setting(word(TEMPERATURE_UNITS), "degC")
    section: Column | None = setting(COLUMN, None, example='"section"')
    faces: Mapping[str, str] = setting(
        LABELLED_FACES, {}, words="none", example='{top = "+z", bottom = "-z"}'
    )
    angle_unit: str | None = setting(
        word(("deg", "rad")), None, words="required with angles", example='"deg"'
    )
    direction: tuple[Column, ...] | None = setting(COLUMNS, None, example='["dx", "dy", "dz"]')
    still_s: float = setting(number(1e-3, 1e5), STILL_S, "s")
    frame: str = setting(word(("sensor", "case")), "sensor")
    pitch: Column | None = setting(COLUMN, None)
    roll: Column | None = setting(COLUMN, None)
    yaw: Column | None = setting(COLUMN, None)
    zenith: Column | None = setting(COLUMN, None)
    tool_face: Column | None = setting(COLUMN, None)
    azimuth: Column | None = setting(COLUMN, None)
    table: str = "recording"

    @property
    def reading_of_1_g(self) -> float | None:
        """Reading that 1 g should give, if the unit states it."""
        return ACCELERATION_UNITS[self.acceleration_unit]

    @property
    def written(self) -> FileLayout:
        """How the file is written."""
        columns = [c.column for c in self.acceleration]
        columns += [*self.time, *(self.gyro or ()), *(self.angles.columns if self.angles else ())]
        columns += [column for column in (self.temperature, self.section) if column is not None]
        return self.layout(self.table, columns)

    @property
    def clock(self) -> ClockLayout:
        """Where the times are."""
        return ClockLayout(self.time, self.time_unit, self.sample_rate_hz)

    @property
    def angles(self) -> Angles | None:
        """Angles of the rows, None without them; directions are turned into aircraft angles."""
        if self.direction is not None:
            return Angles(AIRCRAFT, self.direction, "deg", vectors=True)
        for kind_of_angles, names in ANGLE_NAMES.items():
            columns = tuple(c for c in (getattr(self, name) for name in names) if c is not None)
            if columns:
                return Angles(kind_of_angles, columns, self.angle_unit or "")
        return None


RECORDING = TableKeys.of(RecordingLayout)


def read_layout(path: Path) -> RecordingLayout:
    """Layout of a recording from the table [recording] of a TOML file, as a unit.toml is one.

    Raises
    ------
    RefusedError
        When the file has no such table, or it breaks a rule.
    """
    table = read_toml(path).get("recording")
    if table is None:
        raise RefusedError(
            f"{path}",
            "no table [recording]",
            expected="the layout of a recording",
            remedy="state the columns there; the recordings of [test.NAME] are for triaxcal report",
        )
    keys = RECORDING.but(file={"default": "recording.csv"})
    file = FileKeys(path.name, "The layout of a recording", (keys,))
    layout = recording_layout(file.check(str(path), {"recording": table})["recording"])
    assert layout is not None
    return layout


def recording_layout(values: Values) -> RecordingLayout | None:
    """Layout in a table [recording]; None when there is none.

    Raises
    ------
    RefusedError
        For a wrong value, and for keys that contradict each other.
    """
    if not values:
        return None
    name = values[values.keys["preset"]]
    values = replace(values, given={**(PRESETS[name] if name else {}), **values.given})
    layout = values.record(RecordingLayout)
    for required in ("acceleration", "acceleration_unit"):
        if required not in values:
            presets = "or name a preset: " + ", ".join(PRESETS)
            raise values.missing(required, values.keys[required].kind.expected, presets)
    check_units(values, layout.time, layout.time_unit)
    if layout.section is None and layout.rows == SECTIONS:
        raise values.missing("section", "the column that numbers or names the poses")
    if layout.section is None and "faces" in values:
        raise RefusedError(values.where("faces"), "given without section", expected="its column")
    _check_angles(values, layout)
    # A time column says more than a rate; a preset's rate yields to it.
    return layout if not layout.time else replace(layout, sample_rate_hz=None)


def _check_angles(values: Values, layout: RecordingLayout) -> None:
    kinds = [k for k, names in ANGLE_NAMES.items() if any(name in values for name in names)]
    if "direction" in values:
        if kinds or layout.faces:
            raise RefusedError(
                values.where("direction"),
                "given together with " + ("faces" if layout.faces else "angles"),
                expected="one of them: each says how a pose lies",
            )
        _refuse_samples(values, layout, "direction")
        return
    if not kinds:
        return
    if len(kinds) == 2:
        raise RefusedError(
            values.where("pitch"),
            "aircraft and inclinometer angles together",
            expected="pitch and roll, or zenith and tool_face",
        )
    names = ANGLE_NAMES[kinds[0]][:2]
    for name, expected in (
        *((n, " and ".join(names)) for n in names),
        ("angle_unit", '"deg" or "rad"'),
    ):
        if name not in values:
            raise values.missing(name, expected)
    _refuse_samples(values, layout, names[0])


def _refuse_samples(values: Values, layout: RecordingLayout, name: str) -> None:
    if layout.rows == SAMPLES:
        what = "directions" if name == "direction" else "angles"
        raise RefusedError(
            values.where(name),
            f"{what} with rows of samples",
            expected='rows = "poses", one row a pose, or "sections"',
        )
