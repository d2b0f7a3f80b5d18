"""`load_imu`: the calibration.json of an IMU."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from triaxcal.api.imu import ImuCalibration
from triaxcal.base.errors import RefusedError, refused_by_system
from triaxcal.dynamic.blocks.registry import EXTENSIONS

FORMAT = 1
"""Of the calibration.json that `load_imu` reads."""
_DAMAGE = (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError)


def load_imu(path: str | Path) -> ImuCalibration:
    """Calibration from the calibration.json of an IMU.

    Raises
    ------
    RefusedError
        When the file cannot be read, or is not that of an IMU.
    """
    try:
        document = json.loads(Path(path).read_bytes())
        if document["kind"] != "dynamic":
            raise KeyError("kind")
        if document["format"] != FORMAT:
            raise RefusedError(
                f"{path}, format", f"found {document['format']!r}", expected=f"{FORMAT}"
            )
        found = ImuCalibration(document, source=str(path))
        _refuse_damage(str(path), found)
    except OSError as error:
        raise refused_by_system(path, "read", error) from error
    except _DAMAGE as error:
        raise RefusedError(
            str(path),
            f"no calibration.json of an IMU: {type(error).__name__} {error}",
            expected="the file that `triaxcal calib` wrote for an IMU",
            remedy="load a triad's calibration with load(path)",
        ) from error
    return found


def _refuse_damage(path: str, found: ImuCalibration) -> None:
    """Refuse states of another layout, and numbers that are none."""
    document, size = found.document, len(found.states)
    for name in document["blocks"]:
        if name not in EXTENSIONS:
            raise RefusedError(
                f"{path}, blocks",
                f"found {name!r}",
                expected=f"some of {', '.join(EXTENSIONS.names)}",
            )
    names = [state.name for state in found.layout.states]
    if [row["name"] for row in document["states"]] != names:
        raise RefusedError(
            f"{path}, states",
            "not the states of its blocks, in their order",
            expected=f"{len(names)} states, {names[0]} to {names[-1]}",
        )
    numbers: dict[str, Any] = {
        "states": [(s.value, s.sd) for s in found.states.values()],
        "covariance": found.covariance,
        "reference_degc": found.reference_degc,
        "local_gravity_m_per_s2": float(document["local_gravity_m_per_s2"]),
        "range_degc": found.range_degc or 0.0,
        "gyro_range_degc": found.gyro_range_degc or 0.0,
    }
    for key, value in numbers.items():
        if not np.isfinite(value).all():
            raise RefusedError(f"{path}, {key}", "a number is not finite", expected="numbers")
    if found.covariance.shape != (size, size):
        raise RefusedError(
            f"{path}, covariance",
            f"found the shape {found.covariance.shape}",
            expected=f"({size}, {size})",
        )
