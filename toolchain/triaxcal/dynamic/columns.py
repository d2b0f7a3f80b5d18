"""[dynamic] of unit.toml: the recording of an IMU, and its columns in SI units."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import TableKeys, Values, setting
from triaxcal.base.kinds import TEXT, Kind, listed, number, word
from triaxcal.dynamic.blocks.registry import EXTENSIONS
from triaxcal.dynamic.noise import MICRO_G
from triaxcal.dynamic.recording import CONVENTIONS, INCREMENT
from triaxcal.model.thermal.shape import PLAUSIBLE_DEGC
from triaxcal.readings.table import Quantity, signed
from triaxcal.readings.units import to_degc
from triaxcal.unit.recordingfile import (
    COLUMN,
    SIGNED_COLUMNS,
    STAMPS,
    TEMPERATURE_UNITS,
    TIMES,
    Column,
    SignedColumn,
    WrittenFile,
)

_RATE_UNITS = {"rad/s": 1.0, "deg/s": math.pi / 180, "deg/h": math.pi / 648000}
_ANGLE_UNITS = {"rad": 1.0, "deg": math.pi / 180, "arcsec": math.pi / 648000}
_FORCE_UNITS = {"m/s^2": 1.0, "g": 1e6 * MICRO_G, "mg": 1e3 * MICRO_G}
_VELOCITY_UNITS = {"m/s": 1.0, "mm/s": 1e-3}


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
        Gyros x, y, z; "-gy" turns a sign.
    rate_unit
        Unit of the gyros: of instants the first three, of increments the others.
    rate_samples
        What a reading is: of the instant of its stamp, or over the interval that ends there.
    rate_max
        Full scale of the gyros: a reading beyond 0.999 of it is refused.
    force_columns
        Accelerometers x, y, z, on the axes of the gyros.
    force_unit
        Unit of the accelerometers (g of 9.80665 m/s^2): of instants the first three, of
        increments the others.
    force_samples
        As `rate_samples`.
    force2_columns
        A second accelerometer triad, in the same unit.
    temp_column
        Temperature; required by the blocks of temperature.
    temperature_unit
        Unit of `temp_column`.
    table_angle_column
        Angle of the table; required by the blocks of the table's angle.
    reference_degc
        Temperature at which the constants are given, and from which it is counted.
    blocks
        Extensions that are switched on.
    """

    time_column: tuple[Column, ...] = setting(TIMES, (), words="none", example='"time_s"')
    time_unit: tuple[str, ...] = setting(STAMPS, ("s",), words='`"s"`', example='"s"')
    rate_hz: float | None = setting(number(1.0, 1e5), None, "Hz", example="200")
    rate_columns: tuple[SignedColumn, ...] = setting(SIGNED_COLUMNS, example='["gx", "gy", "gz"]')
    rate_unit: str = setting(word((*_RATE_UNITS, *_ANGLE_UNITS)), example='"deg/s"')
    rate_samples: str = setting(word(CONVENTIONS), example='"instant"')
    rate_max: float | None = setting(number(1e-3, 1e5), None, "deg/s", example="300")
    force_columns: tuple[SignedColumn, ...] = setting(SIGNED_COLUMNS, example='["ax", "ay", "az"]')
    force_unit: str = setting(word((*_FORCE_UNITS, *_VELOCITY_UNITS)), example='"m/s^2"')
    force_samples: str = setting(word(CONVENTIONS), example='"instant"')
    force2_columns: tuple[SignedColumn, ...] | None = setting(SIGNED_COLUMNS, None)
    temp_column: Column | None = setting(COLUMN, None)
    temperature_unit: str = setting(word(TEMPERATURE_UNITS[:3]), TEMPERATURE_UNITS[0])
    table_angle_column: Column | None = setting(COLUMN, None, "deg")
    reference_degc: float = setting(number(*PLAUSIBLE_DEGC), 20.0, "degC")
    blocks: tuple[str, ...] = setting(
        listed(TEXT, range(100), "a list of names in quotes"), (), words="none"
    )


def dynamic_table() -> TableKeys:
    """Keys of [dynamic], with the extensions that there are."""
    names = EXTENSIONS.names
    blocks = listed(
        word(names), range(100), f"names out of {', '.join(names)}, each once", different=True
    )
    return TableKeys.of(DynamicTable).but(blocks={"kind": blocks, "doc": EXTENSIONS.explained})


def quantities_of(values: Values, found: DynamicTable) -> tuple[Quantity, ...]:
    """Columns by the names of `ImuSamples`, and their conversion to SI units.

    Raises
    ------
    RefusedError
        For a unit of increments where instants are read, and the other way round.
    """
    rate_units = _ANGLE_UNITS if found.rate_samples == INCREMENT else _RATE_UNITS
    force_units = _VELOCITY_UNITS if found.force_samples == INCREMENT else _FORCE_UNITS
    for name, units in (("rate_unit", rate_units), ("force_unit", force_units)):
        if values.given[name] not in units:
            raise values.refuse(name, word(tuple(units)).expected)
    force_scale = force_units[found.force_unit]
    quantities = [
        signed("rate", "rate_columns", found.rate_columns, rate_units[found.rate_unit]),
        signed("force", "force_columns", found.force_columns, force_scale),
    ]
    if found.force2_columns is not None:
        quantities.append(signed("force2", "force2_columns", found.force2_columns, force_scale))
    if found.temp_column is not None:
        degc = to_degc(found.temperature_unit)
        quantities.append(Quantity("temp_degc", "temp_column", (found.temp_column,), degc))
    if found.table_angle_column is not None:
        column = (found.table_angle_column,)
        quantities.append(Quantity("table_angle_rad", "table_angle_column", column, np.radians))
    return tuple(replace(quantity, apart=True) for quantity in quantities)


def refuse_two_temperatures(values: Values, found: DynamicTable) -> None:
    """Refuse temperatures that are both stated and recorded, or stated of some recordings only.

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
    if any(stated) and not all(stated):
        raise RefusedError(
            values.where("recording"),
            f"temp_degc of {sum(stated)} of {len(stated)} recordings",
            expected="temp_degc of each recording, or of none",
        )


def names_of(found: DynamicTable) -> list[Column]:
    """Columns, single or in triads."""
    triads = (*found.rate_columns, *found.force_columns, *(found.force2_columns or ()))
    single = (found.temp_column, found.table_angle_column)
    return [*found.time_column, *(c.column for c in triads), *(c for c in single if c is not None)]


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
