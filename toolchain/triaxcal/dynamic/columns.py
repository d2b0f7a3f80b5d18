"""[dynamic] of unit.toml: the recording of an IMU, and its columns."""

from __future__ import annotations

from dataclasses import dataclass

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import TableKeys, Values, setting
from triaxcal.base.kinds import TEXT, Kind, listed, number, word
from triaxcal.dynamic.blocks.registry import EXTENSIONS
from triaxcal.dynamic.recording import CONVENTIONS, MOTIONS
from triaxcal.dynamic.scales import ANGLE_UNITS, FORCE_UNITS, RATE_UNITS, UPWARD, VELOCITY_UNITS
from triaxcal.model.thermal.shape import PLAUSIBLE_DEGC
from triaxcal.unit.recordingfile import (
    COLUMN,
    FILE,
    SIGNED_COLUMNS,
    STAMPS,
    TEMPERATURE_UNITS,
    TIMES,
    Column,
    SignedColumn,
    WrittenFile,
)


@dataclass(frozen=True)
class RecordedFile:
    """A recording: its file, and the temperature that is stated of it, where one is."""

    file: str
    temp_degc: float | None = None


def _recorded_files(value: object) -> tuple[RecordedFile, ...]:
    if isinstance(value, str):
        return (RecordedFile(value),)
    if not isinstance(value, list) or not value:
        raise ValueError
    found = []
    for row in value:
        if not isinstance(row, dict) or not {"file"} <= set(row) <= {"file", "temp_degc"}:
            raise ValueError
        stated = row.get("temp_degc")
        degc = None if stated is None else number(*PLAUSIBLE_DEGC).parse(stated)
        found.append(RecordedFile(TEXT.parse(row["file"]), degc))
    if len({f.file for f in found}) != len(found):
        raise ValueError
    return tuple(found)


_RECORDED: Kind[tuple[RecordedFile, ...]] = Kind(
    "the name of a file; or several recordings, each a table [[dynamic.recording]] with file, "
    "each file once, and at choice temp_degc",
    _recorded_files,
    {
        "oneOf": [
            TEXT.schema,
            {
                "type": "array",
                "minItems": 1,
                "items": {
                    "type": "object",
                    "properties": {
                        "file": TEXT.schema,
                        "temp_degc": number(*PLAUSIBLE_DEGC).schema,
                    },
                    "required": ["file"],
                    "additionalProperties": False,
                },
            },
        ]
    },
    example='"recording.csv"',
)


@dataclass(frozen=True, kw_only=True)
class _Recorded:
    """The file, before how it is written.

    Attributes
    ----------
    recording
        File of the readings. Several recordings of the unit are tables [[dynamic.recording]] after
        the other keys of [dynamic], each with `file`; `temp_degc` states the temperature of one
        that has no column of it.
    """

    recording: tuple[RecordedFile, ...] = setting(_RECORDED, example='"recording.csv"')


@dataclass(frozen=True, kw_only=True)
class DynamicTable(WrittenFile, _Recorded):
    """[dynamic]: the recording.

    Attributes
    ----------
    time_column
        Time of each sample, or a list as `time` of `[recording]`; or `rate_hz`.
    time_unit
        Unit of the times, as in `[recording]`.
    rate_hz
        Rate of even samples, in place of `time_column`.
    rate_columns
        Gyros x, y, z; "-gy", or -5 of a number, turns a sign.
    rate_unit
        Unit of the gyros: of instants the first four, of increments the others. "count" are raw
        counts of the nominal size `rate_counts_per_deg_per_s`; counts about half of their range
        are taken from there.
    rate_counts_per_deg_per_s
        Nominal size of "count": the data sheet's sensitivity.
    rate_samples
        What a reading is: of the instant of its stamp, or over the interval that ends there.
    rate_max
        Full scale of the gyros: a reading beyond 0.999 of it is refused.
    force_columns
        Accelerometers x, y, z, on the axes of the gyros.
    force_unit
        Unit of the accelerometers (g of 9.80665 m/s^2): of instants the first four, of
        increments the others. "count" as of the gyros.
    force_counts_per_g
        Nominal size of "count".
    force_samples
        As `rate_samples`.
    force_recording
        File of the accelerometers, where they have one of their own.
    force_time_column
        Time of the accelerometers, where they have a column of their own.
    up_at_start
        Axis that points up at the first rest, as "+z": forces of reversed sign are turned.
    force2_columns
        A second accelerometer triad, in the same unit.
    temp_column
        Temperature; required by the blocks of temperature.
    gyro_temp_column
        Temperature of the gyros, where they have a thermometer of their own; `temp_column` is that
        of the accelerometers then.
    temperature_unit
        Unit of the temperatures.
    table_angle_column
        Angle of the table; required by the blocks of the table's angle.
    reference_degc
        Temperature at which the constants are given, and from which it is counted.
    blocks
        Extensions that are switched on.
    motion
        How the unit is turned: by "hand" the accelerometers are used at rest only, on a "table"
        in all turns about an axis too.
    """

    time_column: tuple[Column, ...] = setting(TIMES, (), words="none", example='"time_s"')
    time_unit: tuple[str, ...] = setting(STAMPS, ("s",), words='`"s"`', example='"s"')
    rate_hz: float | None = setting(number(1.0, 1e5), None, "Hz", example="200")
    rate_columns: tuple[SignedColumn, ...] = setting(SIGNED_COLUMNS, example='["gx", "gy", "gz"]')
    rate_unit: str = setting(word((*RATE_UNITS, *ANGLE_UNITS)), example='"deg/s"')
    rate_counts_per_deg_per_s: float | None = setting(number(1e-6, 1e9), None, example="131")
    rate_samples: str = setting(word(CONVENTIONS), example='"instant"')
    rate_max: float | None = setting(number(1e-3, 1e5), None, "deg/s", example="300")
    force_columns: tuple[SignedColumn, ...] = setting(SIGNED_COLUMNS, example='["ax", "ay", "az"]')
    force_unit: str = setting(word((*FORCE_UNITS, *VELOCITY_UNITS)), example='"m/s^2"')
    force_counts_per_g: float | None = setting(number(1e-6, 1e9), None, example="16384")
    force_samples: str = setting(word(CONVENTIONS), example='"instant"')
    force_recording: str | None = setting(FILE, None, words="`recording`", example='"acc.csv"')
    force_time_column: tuple[Column, ...] = setting(TIMES, (), words="`time_column`")
    up_at_start: str | None = setting(word(UPWARD), None, words="not checked", example='"+z"')
    force2_columns: tuple[SignedColumn, ...] | None = setting(SIGNED_COLUMNS, None)
    temp_column: Column | None = setting(COLUMN, None)
    gyro_temp_column: Column | None = setting(COLUMN, None, words="`temp_column`")
    temperature_unit: str = setting(word(TEMPERATURE_UNITS[:3]), TEMPERATURE_UNITS[0])
    table_angle_column: Column | None = setting(COLUMN, None, "deg")
    reference_degc: float = setting(number(*PLAUSIBLE_DEGC), 20.0, "degC")
    blocks: tuple[str, ...] = setting(
        listed(TEXT, range(100), "a list of names in quotes"), (), words="none"
    )
    motion: str | None = setting(word(MOTIONS), None, words="found in the recording")


def dynamic_table() -> TableKeys:
    """Keys of [dynamic], with the extensions that there are."""
    names = EXTENSIONS.names
    blocks = listed(
        word(names), range(100), f"names out of {', '.join(names)}, each once", different=True
    )
    return TableKeys.of(DynamicTable).but(blocks={"kind": blocks, "doc": EXTENSIONS.explained})


def refuse_two_temperatures(values: Values, found: DynamicTable) -> None:
    """Refuse temperatures that are both stated and recorded, or stated of some recordings only.

    And those of the gyros alone.

    Raises
    ------
    RefusedError
    """
    stated = [recorded.temp_degc is not None for recorded in found.recording]
    if found.temp_column is not None and any(stated):
        raise RefusedError(
            values.where("recording"),
            "temp_degc and temp_column are both given",
            expected="one of them: a column of temperatures, or the temperature of each recording",
        )
    if found.gyro_temp_column is not None and found.temp_column is None:
        raise RefusedError(
            values.where("gyro_temp_column"),
            "given, and no temp_column",
            expected="temp_column as well: the temperature of the accelerometers",
        )
    if any(stated) and not all(stated):
        raise RefusedError(
            values.where("recording"),
            f"temp_degc of {sum(stated)} of {len(stated)} recordings",
            expected="temp_degc of each recording, or of none",
        )


_COLUMN_OF = {
    "temp_degc": "temp_column",
    "force2": "force2_columns",
    "table_angle_rad": "table_angle_column",
}


def blocks_of(values: Values, found: DynamicTable) -> tuple[str, ...]:
    """Extensions that are switched on.

    Raises
    ------
    RefusedError
        Where one needs a column that is not named.
    """
    for name in found.blocks:
        for block in EXTENSIONS[name].blocks:
            key = _COLUMN_OF.get(block.needs, "")
            stated = key == "temp_column" and found.recording[0].temp_degc is not None
            if key and key not in values and not stated:
                raise RefusedError(
                    values.where("blocks"),
                    f'"{name}" is switched on and no {key} is given',
                    expected=f"{key} in [dynamic]",
                    remedy="name the column, or switch the block off",
                )
    return found.blocks
