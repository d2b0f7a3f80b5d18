"""The record of a device that was verified: whose, when, and what each check position gave."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

from triaxcal.base.errors import RefusedError, refused_by_system
from triaxcal.base.jsontext import json_bytes
from triaxcal.base.plaindata import plain, rebuilt

FORMAT = 1


@dataclass(frozen=True)
class PositionResult:
    """What a device gave at rest in a check position.

    Attributes
    ----------
    position : str
        Name of the check position.
    samples : int
        How many; of each, result and status were those of the integer model.
    temp_degc : float
        Their mean temperature.
    mean_g : tuple of three floats
        Mean compensated specific force x, y, z, in g of 9.80665 m/s^2.
    error_g : float
        Length of that mean, minus the local gravity.
    standard_error_g : float
        By the scatter of |a|, as if the samples were independent.
    limit_g : float
        Largest | |a| - g | that the unit accepts at this temperature.
    """

    position: str
    samples: int
    temp_degc: float
    mean_g: tuple[float, float, float]
    error_g: float
    standard_error_g: float
    limit_g: float


@dataclass(frozen=True)
class DeviceRecord:
    """A device with a calibration in flash, verified at check positions.

    Attributes
    ----------
    unit, serial : str
        Name of the unit, and serial number of the calibration.
    hardware : str
        Serial number that the device itself knows; "" where it knows none.
    firmware : str
        Version of the device's firmware.
    image_sha256 : str
        Of the image in flash, as it was read back.
    date : str
        Day, as 2026-03-30.
    gravity_m_per_s2 : float
        Local gravity where it was verified.
    largest_difference_lsb : int
        Between device and integer model, over all samples.
    positions : tuple of PositionResult
    """

    unit: str
    serial: str
    hardware: str
    firmware: str
    image_sha256: str
    date: str
    gravity_m_per_s2: float
    largest_difference_lsb: int
    positions: tuple[PositionResult, ...]

    @property
    def samples(self) -> int:
        """Samples in all positions."""
        return sum(p.samples for p in self.positions)

    @property
    def worst(self) -> PositionResult:
        """The position that is nearest to its limit."""
        return max(self.positions, key=lambda p: abs(p.error_g) / p.limit_g)

    def is_of(self, image: bytes) -> bool:
        """Whether the device had this image."""
        return self.image_sha256 == sha256_of(image)


def sha256_of(image: bytes) -> str:
    """Hash by which a record names an image."""
    return hashlib.sha256(image).hexdigest()


def record_path(target: Path) -> Path:
    """Where the record of the delivery in the folder `target` is: beside it."""
    return target.with_name(f"{target.name}.device.json")


def record_bytes(record: DeviceRecord) -> bytes:
    """The record as JSON."""
    return json_bytes({"format": FORMAT, **plain(record)})


def read_record(path: Path) -> DeviceRecord | None:
    """The record in a file; None where there is no file.

    Raises
    ------
    RefusedError
        When it cannot be read, or is no record.
    """
    try:
        return parsed_record(path.read_bytes(), str(path))
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise refused_by_system(path, "read", error) from error


def parsed_record(content: bytes, where: str) -> DeviceRecord:
    """The record in the content of a file; `where` names it in messages.

    Raises
    ------
    RefusedError
        When it is no record.
    """
    try:
        document = json.loads(content)
        if document.pop("format") != FORMAT:
            raise ValueError(f"format is not {FORMAT}")
        record = rebuilt(DeviceRecord, document)
        if not record.positions or not all(p.limit_g > 0 for p in record.positions):
            raise ValueError("no positions, or no limit")
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise RefusedError(
            where,
            f"no record of a device: {type(error).__name__} {error}",
            expected="what `triaxcal device verify --positions` writes",
            remedy="remove it, and verify the device again",
        ) from error
    return record
