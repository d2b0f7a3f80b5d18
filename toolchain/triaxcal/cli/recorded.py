"""What the commands that look at a recording share."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from triaxcal.base.errors import RefusedError

if TYPE_CHECKING:
    from triaxcal.readings.samples import Samples
    from triaxcal.unit.recording import RecordingLayout


def recorded(folder: Path) -> tuple[RecordingLayout, Samples]:
    """Layout and samples of a unit's recording.

    Raises
    ------
    RefusedError
        When the unit has none, or it cannot be read.
    """
    from triaxcal.base.tomltable import has_table  # noqa: PLC0415
    from triaxcal.readings.samples import read_samples  # noqa: PLC0415
    from triaxcal.unit.description import find_unit, read_unit  # noqa: PLC0415

    if has_table(find_unit(folder), "dynamic"):
        raise RefusedError(
            f"{folder}/unit.toml",
            "a whole IMU on a turntable, [dynamic]",
            expected="a unit with a table [recording]",
            remedy=f"`triaxcal dynamic {folder}` calibrates it",
        )
    unit = read_unit(folder)
    if unit.recording is None:
        raise RefusedError(
            f"{folder}/unit.toml",
            "no table [recording]",
            expected="a unit whose readings are a recording",
            remedy="see docs/how-to/recordings.md",
        )
    return unit.recording, read_samples(folder, unit.recording, unit.temperature_sensor)


def write_picture(path: Path, content: bytes) -> None:
    """Write a picture whole or not at all."""
    aside = path.with_name(f".{path.name}.part")
    try:
        aside.write_bytes(content)
        aside.replace(path)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise RefusedError(str(path), f"cannot be written: {reason}") from error
    finally:
        aside.unlink(missing_ok=True)
