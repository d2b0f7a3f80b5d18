"""A target of `triaxcal export`: files that are made of a delivered folder."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.delivery.fitted import Fitted
from triaxcal.delivery.fittedimu import FittedImu
from triaxcal.exports.triad import Gyro, Triad, triad_of, triads_of


@dataclass(frozen=True)
class Source:
    """What was delivered for a unit.

    Attributes
    ----------
    folder : Path
        With the C and verification.json.
    fitted : Fitted or FittedImu
        The calibration in its calibration.json.
    c : dict or None
        C and image that were made of it since, under another prefix; None: those in the folder.
    """

    folder: Path
    fitted: Fitted | FittedImu
    c: dict[str, bytes] | None = None

    @property
    def serial(self) -> str:
        """Serial number."""
        return self.fitted.serial if isinstance(self.fitted, FittedImu) else self.fitted.unit.serial

    @property
    def sensor(self) -> str:
        """What it is, in words."""
        return "IMU" if isinstance(self.fitted, FittedImu) else "accelerometer"

    def triads(self) -> tuple[Triad, Gyro | None]:
        """The accelerometer, and the gyro of an IMU."""
        if isinstance(self.fitted, FittedImu):
            return triads_of(self.fitted)
        return triad_of(self.fitted), None

    def c_files(self) -> dict[str, bytes]:
        """Name and content of the C and the image, which are those that were checked.

        Raises
        ------
        RefusedError
            When one is missing, or is not the one in verification.json.
        """
        if self.c is not None:
            return self.c
        path = self.folder / "verification.json"
        try:
            hashes: dict[str, str] = json.loads(path.read_bytes())["files_sha256"]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise RefusedError(
                str(path),
                "missing, or does not name the files of the firmware",
                expected="a delivered folder",
                remedy="run `triaxcal calib` for the unit first",
            ) from error
        return {name: self._checked(name, digest) for name, digest in hashes.items()}

    def _checked(self, name: str, digest: str) -> bytes:
        path = self.folder / name
        content = path.read_bytes() if path.is_file() else b""
        if hashlib.sha256(content).hexdigest() != digest:
            raise RefusedError(
                str(path),
                "is missing or is not the file that was checked",
                expected=f"SHA-256 {digest[:16]}..., as in verification.json",
                remedy="run `triaxcal calib` for the unit again",
            )
        return content


@dataclass(frozen=True)
class Exported:
    """Files by their path below the folder that receives them, and what is said of them."""

    files: dict[str, bytes]
    summary: str


@dataclass(frozen=True)
class Target:
    """Entry of a target; `make` gives the same for the same delivery.

    `takes_c` is False where only parameters are written, in which no prefix stands.
    """

    name: str
    label: str
    doc: str
    make: Callable[[Source], Exported]
    rank: int = 100
    takes_c: bool = True
