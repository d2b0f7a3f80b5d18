"""unit.toml of an IMU whose log a rig recorded: the first one."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from triaxcal.base.errors import RefusedError, refused_by_system
from triaxcal.base.publish import renew
from triaxcal.base.tomltable import read_toml
from triaxcal.rig.description.description import RigDescription
from triaxcal.rig.description.recorded import Recorded, unit_of
from triaxcal.rig.description.rigkeys import RIG_FILE
from triaxcal.unit.folder import UNIT_FILE
from triaxcal.unit.recordingfile import is_in_folder

LOG_FILE = "frames.log"


@dataclass(frozen=True)
class Place:
    """Where the unit is turned."""

    latitude_deg: float
    gravity_m_per_s2: float


def refuse_files_elsewhere(rig_file: Path, folder: Path) -> list[str]:
    """Bus descriptions that a rig description names, which go into the folder of a unit with it.

    Raises
    ------
    RefusedError
        When one does not lie beside it.
    """
    if _is_there(rig_file, folder):
        return []
    keys = read_toml(rig_file).get("rig")
    named = [keys.get("file"), *keys.get("more_files", [])] if isinstance(keys, dict) else []
    names = [name for name in named if name is not None]
    for name in names:
        if not is_in_folder(name):
            raise RefusedError(
                f"{rig_file}, [rig]",
                f"{name} does not lie beside it",
                expected="bus descriptions that can be copied to the unit with it",
                remedy="put a copy beside the rig description, and name that",
            )
    return names


def copy_description(rig_file: Path, folder: Path) -> None:
    """Copy a rig description and the bus descriptions that it names into the folder of a unit.

    Raises
    ------
    RefusedError
        When one lies elsewhere, or the disk refuses.
    """
    names = refuse_files_elsewhere(rig_file, folder)
    if _is_there(rig_file, folder):
        return
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, source in ((RIG_FILE, rig_file), *((n, rig_file.parent / n) for n in names)):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, folder / name)
    except OSError as error:
        raise refused_by_system(error.filename or folder, "written", error) from error


def _is_there(rig_file: Path, folder: Path) -> bool:
    return rig_file.parent.absolute() == folder.absolute() and rig_file.name == RIG_FILE


def write_first_unit(folder: Path, rig: RigDescription, place: Place) -> Path:
    """Write unit.toml for the log in a folder.

    Raises
    ------
    RefusedError
        When the disk refuses.
    """
    lines = [
        "# Written by `triaxcal rig imu`. docs/how-to/imu.md explains it; docs/reference/keys.md",
        "# has every key. Add [device] for the C, [limits] for what is demanded, [noise] where a",
        "# data sheet states it; without it the noise is that of the recording.",
        "format = 1",
        f'serial = "{folder.absolute().name}"',
        "",
        "[site]",
        f"latitude_deg = {place.latitude_deg!r}",
        f"local_gravity_m_per_s2 = {place.gravity_m_per_s2!r}",
        "",
        "[dynamic]",
        f'recording = "{LOG_FILE}"',
        f'rig = "{RIG_FILE}"',
        'time_column = "sample_time"',
        'time_unit = "ns"',
        'rate_columns = ["gyro_x", "gyro_y", "gyro_z"]',
        f'rate_unit = "{_named(rig.gyros, "deg/s")}"',
        'rate_samples = "instant"',
        'force_columns = ["x", "y", "z"]',
        f'force_unit = "{_named(rig.axes, "g")}"',
        'force_samples = "instant"',
        *_temperature_lines(rig),
        "",
    ]
    renew({UNIT_FILE: "\n".join(lines).encode()}, folder)
    return folder / UNIT_FILE


def _temperature_lines(rig: RigDescription) -> list[str]:
    if rig.temperature is None:
        return []
    unit = _named((rig.temperature,), "degC")
    return ['temp_column = "temperature"', f'temperature_unit = "{unit}"']


def _named(axes: Sequence[Recorded], common: str) -> str:
    """Unit of the columns of some axes: theirs, or the common one that they are brought to."""
    units = {unit_of(axis.unit) for axis in axes}
    known = {"m/s^2", "g", "mg", "deg/s", "rad/s", "deg/h", "degC", "K", "degF"}
    return units.pop() if len(units) == 1 and units <= known else common
