"""unit.toml of a unit on a turntable: [site], [dynamic], [noise], [table], [device]."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import FileKeys, Key, TableKeys, Values, keys_of, setting
from triaxcal.base.kinds import TEXT, Kind, listed, number, word
from triaxcal.base.tomltable import has_table
from triaxcal.dynamic.blocks.block import StateBlock
from triaxcal.dynamic.blocks.registry import EXTENSIONS
from triaxcal.dynamic.device import DEVICE, Device, device_of
from triaxcal.dynamic.noise import MICRO_G, DataSheet
from triaxcal.dynamic.recording import CONVENTIONS, INCREMENT, Turntable
from triaxcal.model.thermal.shape import PLAUSIBLE_DEGC
from triaxcal.model.types import FloatArray
from triaxcal.readings.table import Quantity, signed
from triaxcal.readings.units import to_degc
from triaxcal.unit.description import (
    GRAVITY,
    LATITUDE,
    SERIAL,
    TOP,
    UNIT_FILE,
    find_unit,
)
from triaxcal.unit.recordingfile import (
    COLUMN,
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

_RATE_UNITS = {"rad/s": 1.0, "deg/s": math.pi / 180, "deg/h": math.pi / 648000}
_ANGLE_UNITS = {"rad": 1.0, "deg": math.pi / 180, "arcsec": math.pi / 648000}
_FORCE_UNITS = {"m/s^2": 1.0, "g": 1e6 * MICRO_G, "mg": 1e3 * MICRO_G}
_VELOCITY_UNITS = {"m/s": 1.0, "mm/s": 1e-3}


@dataclass(frozen=True)
class DynamicDescription:
    """A unit on a turntable.

    Attributes
    ----------
    name, serial : str
    path : Path
        Its unit.toml, for messages.
    recording : Path
    file : FileLayout
        How the recording is written.
    clock : ClockLayout
    quantities : tuple of Quantity
        Its columns, by the names of `ImuSamples`, and their conversion to SI units.
    rate_max : float or None
        Full scale of the gyros, rad/s.
    device : Device or None
        What the firmware's codes are; without it there is no C.
    """

    name: str
    serial: str
    path: Path
    recording: Path
    latitude_deg: float
    gravity_m_per_s2: float
    file: FileLayout
    clock: ClockLayout
    quantities: tuple[Quantity, ...]
    rate_max: float | None
    rate_convention: str
    force_convention: str
    reference_degc: float
    blocks: tuple[str, ...]
    noise: DataSheet
    table: Turntable | None
    device: Device | None = None

    def state_blocks(self) -> tuple[StateBlock, ...]:
        """Blocks of the extensions that are switched on."""
        return tuple(b for name in self.blocks for b in EXTENSIONS[name].blocks)


def _mounting(text: object) -> FloatArray:
    """Matrix of "+x +z": instrument axes along the table's axis, and up at angle zero."""
    words = text.split() if isinstance(text, str) else []
    axes = [_AXES.get(word if word[0] in "+-" else f"+{word}") for word in words]
    if len(axes) != 2 or axes[0] is None or axes[1] is None or axes[0] @ axes[1] != 0:
        raise ValueError
    along, up = axes[0], axes[1]
    return np.column_stack([along, np.cross(up, along), up])


_AXES = {
    sign + axis: value * np.eye(3)[i]
    for sign, value in (("+", 1.0), ("-", -1.0))
    for i, axis in enumerate("xyz")
}


@dataclass(frozen=True, kw_only=True)
class _RecordedFile:
    """The file, before how it is written.

    Attributes
    ----------
    recording
        File of the readings.
    """

    recording: str = setting(TEXT, example='"recording.csv"')


@dataclass(frozen=True, kw_only=True)
class DynamicTable(WrittenFile, _RecordedFile):
    """[dynamic], as it stands in the file.

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
    rate_hz: float | None = setting(number(1.0, 1e5), None, "Hz")
    rate_columns: tuple[SignedColumn, ...] = setting(SIGNED_COLUMNS, example='["gx", "gy", "gz"]')
    rate_unit: str = setting(word((*_RATE_UNITS, *_ANGLE_UNITS)), example='"deg/s"')
    rate_samples: str = setting(word(CONVENTIONS), example='"instant"')
    rate_max: float | None = setting(number(1e-3, 1e5), None, "deg/s")
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


SITE = TableKeys("site", "Where the unit is turned.", (LATITUDE, GRAVITY))
AZIMUTH = Key(
    "azimuth_deg",
    number(-360.0, 360.0),
    "Of the table's axis, from north to the east.",
    unit="deg",
    example="0",
)
ELEVATION = Key("elevation_deg", number(-90.0, 90.0), "Of the axis above the horizon.", 0.0, "deg")
MOUNTINGS = Key(
    "mountings",
    listed(
        Kind("two axes", _mounting, {"type": "string"}),
        range(1000),
        'two instrument axes such as "x z" or "-y x" a mounting: along the table\'s axis, and up',
    ),
    "Per mounting: the instrument axes along the table's axis, and up at angle zero.",
    example='["x z", "y x", "z y"]',
)


def imu_file() -> FileKeys:
    """Keys of the unit.toml of an IMU."""
    names = EXTENSIONS.names
    blocks = listed(
        word(names), range(100), f"names out of {', '.join(names)}, each once", different=True
    )
    return FileKeys(
        UNIT_FILE,
        "A whole IMU on a turntable",
        (
            TOP,
            SITE,
            TableKeys("dynamic", "The recording.", keys_of(DynamicTable)).but(
                blocks={"kind": blocks, "doc": EXTENSIONS.explained}
            ),
            TableKeys("noise", "White noise, as data sheets state it.", keys_of(DataSheet)),
            TableKeys(
                "table",
                "What the papers of the turntable say; for its angle readings.",
                (AZIMUTH, ELEVATION, MOUNTINGS),
                optional=True,
            ),
            DEVICE,
        ),
        ("time_column",),
    )


def read_dynamic(folder: Path) -> DynamicDescription:
    """Description of the unit in `folder`.

    Raises
    ------
    RefusedError
        When there is no such unit or its file breaks a rule of docs/reference/keys.md.
    """
    path = find_unit(folder)
    if not has_table(path, "dynamic"):
        raise RefusedError(
            str(path),
            "no table [dynamic]",
            expected="a whole IMU on a turntable",
            remedy=f"`triaxcal calib {folder}` calibrates this unit; see docs/how-to/imu.md",
        )
    tables = imu_file().read(path)
    dynamic, site = tables["dynamic"], tables["site"]
    found = dynamic.record(DynamicTable)
    where = f"{dynamic.where('time_column')} and rate_hz"
    expected = "one of them: a column of times, or the rate of even sampling"
    absent = RefusedError(where, "neither given", expected=expected)
    if found.rate_hz is not None and found.time_column:
        raise RefusedError(where, "both given", expected=expected)
    check_units(dynamic, found.time_column, found.time_unit)
    return DynamicDescription(
        name=folder.absolute().name,
        serial=tables[""][SERIAL],
        path=path,
        recording=folder / found.recording,
        latitude_deg=site[LATITUDE],
        gravity_m_per_s2=site[GRAVITY],
        file=found.layout("dynamic", _names(found)),
        clock=ClockLayout(
            found.time_column, found.time_unit, found.rate_hz, from_first=False, absent=absent
        ),
        quantities=_quantities(dynamic, found),
        rate_max=None if found.rate_max is None else math.radians(found.rate_max),
        rate_convention=found.rate_samples,
        force_convention=found.force_samples,
        reference_degc=found.reference_degc,
        blocks=_blocks(dynamic, found),
        noise=tables["noise"].record(DataSheet),
        table=_table(tables["table"]),
        device=device_of(tables["device"]),
    )


def _quantities(values: Values, found: DynamicTable) -> tuple[Quantity, ...]:
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
    return tuple(quantities)


def _names(found: DynamicTable) -> list[Column]:
    """Columns that are asked for by themselves or in triads."""
    triads = (*found.rate_columns, *found.force_columns, *(found.force2_columns or ()))
    single = (found.temp_column, found.table_angle_column)
    return [*found.time_column, *(c.column for c in triads), *(c for c in single if c is not None)]


_COLUMN_OF = {
    "temp_degc": "temp_column",
    "force2": "force2_columns",
    "table_angle_rad": "table_angle_column",
}


def _blocks(values: Values, found: DynamicTable) -> tuple[str, ...]:
    for name in found.blocks:
        for block in EXTENSIONS[name].blocks:
            key = _COLUMN_OF.get(block.needs, "")
            if key and key not in values:
                raise RefusedError(
                    values.where("blocks"),
                    f'"{name}" is switched on and no {key} is given',
                    expected=f"{key} in [dynamic]",
                    remedy="name the column, or switch the block off",
                )
    return found.blocks


def _table(values: Values) -> Turntable | None:
    """[table], or None where there is none."""
    if not values:
        return None
    return Turntable(
        math.radians(values[AZIMUTH]),
        math.radians(values[ELEVATION]),
        tuple((math.nan, mounting) for mounting in values[MOUNTINGS]),
    )
