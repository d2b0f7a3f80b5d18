"""unit.toml of an IMU: [site], [dynamic], [noise], [table], [limits], [device]."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import FileKeys, TableKeys, Values, setting
from triaxcal.base.kinds import Kind, listed, number
from triaxcal.base.tomltable import has_table
from triaxcal.dynamic.blocks.block import StateBlock
from triaxcal.dynamic.blocks.registry import EXTENSIONS
from triaxcal.dynamic.columns import (
    DynamicTable,
    RecordedFile,
    blocks_of,
    dynamic_table,
    refuse_two_temperatures,
)
from triaxcal.dynamic.device import DEVICE, Device, device_of, refuse_other_thermometers
from triaxcal.dynamic.limits import IMU_LIMITS, ImuLimits
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.quantities import ForcesApart, forces_apart, names_of, quantities_of
from triaxcal.dynamic.recording import Turntable
from triaxcal.model.thermal.registry import thermal_keys
from triaxcal.model.types import FloatArray
from triaxcal.readings.table import Quantity
from triaxcal.unit.folder import SERIAL, TOP, UNIT_FILE, find_unit
from triaxcal.unit.measured import MEASURED, Measured
from triaxcal.unit.recordingfile import ClockLayout, FileLayout, check_units
from triaxcal.unit.site import TURNING_SITE, TurningSite
from triaxcal.unit.thermal import ThermalChoice, thermal_choice


@dataclass(frozen=True)
class DynamicDescription:
    """A whole IMU.

    Attributes
    ----------
    name, serial : str
    path : Path
        Its unit.toml, for messages.
    recordings : tuple of RecordedFile
        In their order.
    file : FileLayout
        How the recording is written.
    clock : ClockLayout
    quantities : tuple of Quantity
        Its columns, by the names of `ImuSamples`, and their conversion to SI units.
    rate_max : float or None
        Full scale of the gyros, rad/s.
    device : Device or None
        What the firmware's codes are; without it there is no C.
    measured : Measured
        When and where the recording was made.
    limits : ImuLimits
        What is demanded of the constants.
    forces : ForcesApart or None
        Where the accelerometers have a file or times of their own.
    up_at_start : str or None
        Axis that points up at the first rest, as "+z".
    thermal : ThermalChoice, or None
        Which functions the constants follow over temperature.
    motion : str
        How the unit was turned, "" where the recording decides.
    """

    name: str
    serial: str
    path: Path
    recordings: tuple[RecordedFile, ...]
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
    measured: Measured = field(default_factory=Measured)
    limits: ImuLimits = field(default_factory=ImuLimits)
    forces: ForcesApart | None = None
    up_at_start: str | None = None
    thermal: ThermalChoice | None = None
    motion: str = ""

    @property
    def recording(self) -> Path:
        """File of the first recording."""
        return self.path.parent / self.recordings[0].file

    @property
    def recording_words(self) -> str:
        """Name of the recording, or of all of them."""
        return ", ".join(Path(recorded.file).name for recorded in self.recordings)

    @property
    def inputs(self) -> tuple[Path, ...]:
        """Files that the result is made of: unit.toml, recordings, description of their bus."""
        recordings = [recorded.file for recorded in self.recordings]
        if self.forces is not None and self.forces.file is not None:
            recordings.append(self.forces.file)
        bus = (name for name in (self.file.dbc, self.file.rig) if name is not None)
        return self.path, *(self.path.parent / name for name in (*recordings, *bus))

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
class _TablePapers:
    """[table]: what the certificate of the turntable states; for its angle readings.

    Attributes
    ----------
    azimuth_deg
        Of the table's axis, from north to the east.
    elevation_deg
        Of the axis above the horizon.
    mountings
        Per mounting: the instrument axes along the table's axis, and up at angle zero.
    """

    azimuth_deg: float = setting(number(-360.0, 360.0), unit="deg", example="0")
    elevation_deg: float = setting(number(-90.0, 90.0), 0.0, "deg")
    mountings: tuple[FloatArray, ...] = setting(
        listed(
            Kind("two axes", _mounting, {"type": "string"}),
            range(1000),
            'two instrument axes such as "x z" or "-y x" a mounting: along the table\'s axis, and '
            "up",
        ),
        example='["x z", "y x", "z y"]',
    )


THERMAL = TableKeys(
    "thermal",
    "Which functions the constants of both triads follow over temperature. With several recordings "
    "at different temperatures they are chosen where the table is absent as well.",
    thermal_keys(),
    optional=True,
)


def imu_file() -> FileKeys:
    """Keys of the unit.toml of an IMU."""
    return FileKeys(
        UNIT_FILE,
        "A whole IMU",
        (
            TOP,
            TURNING_SITE,
            dynamic_table(),
            TableKeys.of(DataSheet, optional=True),
            TableKeys.of(_TablePapers, optional=True),
            IMU_LIMITS,
            THERMAL,
            DEVICE,
            MEASURED,
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
            expected="a whole IMU",
            remedy=f"`triaxcal calib {folder}` calibrates this unit; see docs/how-to/imu.md",
        )
    tables = imu_file().read(path)
    dynamic, site = tables["dynamic"], tables["site"].record(TurningSite)
    found = dynamic.record(DynamicTable)
    where = f"{dynamic.where('time_column')} and rate_hz"
    expected = "one of them: a column of times, or the rate of even sampling"
    absent = RefusedError(where, "neither given", expected=expected)
    if found.rate_hz is not None and found.time_column:
        raise RefusedError(where, "both given", expected=expected)
    check_units(dynamic, found.time_column, found.time_unit)
    refuse_two_temperatures(dynamic, found)
    clock = ClockLayout(
        found.time_column, found.time_unit, found.rate_hz, from_first=False, absent=absent
    )
    if found.force_recording is not None and len(found.recording) > 1:
        raise RefusedError(
            dynamic.where("force_recording"),
            f"one file of the accelerometers, and {len(found.recording)} recordings",
            expected="one recording, or both triads in each file",
        )
    device = device_of(tables["device"])
    refuse_other_thermometers(device, found.gyro_temp_column is not None, path)
    return DynamicDescription(
        name=folder.absolute().name,
        serial=tables[""][SERIAL],
        path=path,
        recordings=found.recording,
        latitude_deg=site.latitude_deg,
        gravity_m_per_s2=site.local_gravity_m_per_s2,
        file=found.layout("dynamic", names_of(found)),
        clock=clock,
        quantities=quantities_of(dynamic, found),
        rate_max=None if found.rate_max is None else math.radians(found.rate_max),
        rate_convention=found.rate_samples,
        force_convention=found.force_samples,
        reference_degc=found.reference_degc,
        blocks=blocks_of(dynamic, found),
        noise=tables["noise"].record(DataSheet),
        table=_table(tables["table"]),
        device=device,
        measured=tables["measured"].record(Measured),
        limits=tables["limits"].record(ImuLimits),
        forces=forces_apart(found, clock),
        up_at_start=found.up_at_start,
        thermal=_thermal(path, tables["thermal"], found.blocks),
        motion=found.motion or "",
    )


def _thermal(path: Path, values: Values, blocks: tuple[str, ...]) -> ThermalChoice | None:
    """[thermal], or None if there is none."""
    if not has_table(path, "thermal"):
        return None
    both = [n for n in blocks if any(b.needs == "temp_degc" for b in EXTENSIONS[n].blocks)]
    if both:
        raise RefusedError(
            f"{path}, [thermal]",
            f'given besides "{both[0]}" in [dynamic] blocks',
            expected="one of them: functions over temperature, or linear coefficients",
            remedy="remove the block: the functions hold straight lines as well",
        )
    return thermal_choice(values)


def _table(values: Values) -> Turntable | None:
    """[table], or None if there is none."""
    if not values:
        return None
    papers = values.record(_TablePapers)
    return Turntable(
        math.radians(papers.azimuth_deg),
        math.radians(papers.elevation_deg),
        tuple((math.nan, mounting) for mounting in papers.mountings),
    )
