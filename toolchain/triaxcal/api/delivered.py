"""What was delivered for a unit or an IMU, by the name of the unit."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from triaxcal.api.delivery import delivered_file

if TYPE_CHECKING:
    from triaxcal.api.calibration import Calibration
    from triaxcal.api.firmware import Firmware
    from triaxcal.api.imu import ImuCalibration
    from triaxcal.api.imufirmware import ImuFirmware


def load_delivered(unit: str | Path, build: str | Path) -> Calibration | ImuCalibration:
    """The calibration of a unit or an IMU; `unit` and `build` are those of `delivered_file`."""
    from triaxcal.api.calibration import load  # noqa: PLC0415
    from triaxcal.api.imufile import load_imu  # noqa: PLC0415

    path = delivered_file(Path(unit), Path(build))
    return load_imu(path) if _of_an_imu(path) else load(path)


def delivered_firmware(
    unit: str | Path,
    build: str | Path = "build",
    prefix: str | None = None,
    arithmetic: str | None = None,
) -> Firmware | ImuFirmware:
    """The firmware of a unit or an IMU that was calibrated, without a new fit.

    Parameters
    ----------
    unit : path
        A unit, a delivered folder, or its calibration.json.
    build : path
        Folder with the delivered units.
    prefix : str or None
        What names in the C begin with; None is that of the unit.
    arithmetic : str or None
        How the C forms its products; None is that of the unit.

    Raises
    ------
    RefusedError
        When there is no calibration, or no such prefix or arithmetic; as `firmware` and
        `firmware_imu`.
    """
    from triaxcal.api.calibration import Calibration  # noqa: PLC0415
    from triaxcal.api.firmware import firmware  # noqa: PLC0415
    from triaxcal.api.imufirmware import firmware_imu  # noqa: PLC0415

    found = load_delivered(unit, build)
    if isinstance(found, Calibration):
        return firmware(found, prefix, arithmetic)
    return firmware_imu(found, prefix, arithmetic)


def _of_an_imu(path: Path) -> bool:
    """False where the file is damaged: `load` says of what."""
    try:
        document = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(document, dict) and document.get("kind") == "dynamic"
