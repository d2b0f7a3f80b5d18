"""The identity behind the constants in triax_calib.bin: whose they are, under a CRC of its own.

"TRID", version, the CRC of the constants before it, then the fields of `FIELDS`, and a CRC-32 (IEEE
802.3) of the whole file before it. The constants alone are an image as version 0.1.0 wrote it, so
firmware of either version reads them from the first bytes of the file. The CRC of the constants is
repeated because a CRC over a message and its own CRC is the same for every message.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass

from triaxcal import __version__
from triaxcal.base.errors import RefusedError
from triaxcal.codegen.constants import Provenance
from triaxcal.unit.thermometer import TemperatureSensor

MAGIC = int.from_bytes(b"TRID", "little")
VERSION = 1


@dataclass(frozen=True)
class Field:
    """A field: its name, bytes, and what it is; `at` counts from the end of the constants."""

    name: str
    at: int
    size: int
    text: str

    @property
    def macro(self) -> str:
        """Its name in the C."""
        return self.name.upper()


def _placed(*sizes: tuple[str, int, str]) -> tuple[Field, ...]:
    fields, at = [], 12
    for name, size, text in sizes:
        fields.append(Field(name, at, size, text))
        at += size
    return tuple(fields)


FIELDS = _placed(
    ("serial", 64, "serial number"),
    ("date", 12, "day of the measurements, or zeros where unit.toml does not state it"),
    ("inputs", 32, "SHA-256 of the unit's files"),
    ("generator", 16, "version of triaxcal"),
    ("axes", 96, "what raw x, y, z are; cut where it is longer"),
    ("degc_per_code", 8, "IEEE 754 double: degC of a temperature code"),
    ("degc_at_zero", 8, "IEEE 754 double: degC of the code 0"),
)
IDENTITY_SIZE = FIELDS[-1].at + FIELDS[-1].size + 4


@dataclass(frozen=True)
class Identity:
    """Whose constants a file holds.

    Attributes
    ----------
    serial : str
        Serial number of the unit.
    date : str
        Day of the measurements, as 2026-03-30; "" where unit.toml does not state it.
    inputs_sha256 : str
        Hash of the unit's files, 64 hex digits.
    generator : str
        Version of triaxcal.
    axes : str
        What raw x, y, z are: columns with their signs; "" for the outputs of a tilter's unit.
    degc_per_code, degc_at_zero : float
        Scale of the temperature codes.
    """

    serial: str
    date: str
    inputs_sha256: str
    generator: str
    axes: str
    degc_per_code: float
    degc_at_zero: float


def with_identity(image: bytes, sensor: TemperatureSensor, provenance: Provenance) -> bytes:
    """An image with the identity behind it."""
    sizes = {field.name: field.size for field in FIELDS}
    values: dict[str, bytes] = {
        "serial": provenance.serial.encode(),
        "date": provenance.date.encode(),
        "inputs": bytes.fromhex(provenance.inputs_sha256),
        "generator": __version__.encode(),
        "axes": _cut(provenance.axes, sizes["axes"]),
        "degc_per_code": struct.pack("<d", sensor.degc_per_code),
        "degc_at_zero": struct.pack("<d", sensor.degc_at_zero),
    }
    content = image + struct.pack("<II", MAGIC, VERSION) + image[-4:]
    for field in FIELDS:
        content += values[field.name].ljust(field.size, b"\0")[: field.size]
    return content + struct.pack("<I", zlib.crc32(content))


def _cut(text: str, size: int) -> bytes:
    """The first bytes of a text, whole characters only."""
    return text.encode()[:size].decode(errors="ignore").encode()


def identity_of(content: bytes, where: str = "image") -> Identity | None:
    """The identity in a file; None where it holds constants only, as of version 0.1.0.

    `where` is the place that messages name.

    Raises
    ------
    RefusedError
        When the file is no image, cut, or damaged.
    """
    size = int.from_bytes(content[8:12], "little") if len(content) >= 12 else 0
    if size < 16 or len(content) not in (size, size + IDENTITY_SIZE):
        raise RefusedError(
            where,
            f"{len(content)} bytes",
            expected=f"{size or 'the size in its header'} bytes, or {IDENTITY_SIZE} more",
            remedy="read it again, whole",
        )
    image, block = content[:size], content[size:]
    if zlib.crc32(image[:-4]) != int.from_bytes(image[-4:], "little"):
        raise RefusedError(where, "the CRC of the constants is wrong", remedy="read it again")
    if not block:
        return None
    head = struct.unpack_from("<II", block)
    if zlib.crc32(content[:-4]) != int.from_bytes(content[-4:], "little"):
        raise RefusedError(where, "the CRC of the identity is wrong", remedy="read it again")
    if head != (MAGIC, VERSION) or block[8:12] != image[-4:]:
        raise RefusedError(
            where,
            "the identity is of another version, or of other constants",
            remedy="write the file again",
        )
    raw = {field.name: block[field.at : field.at + field.size] for field in FIELDS}
    texts = {
        name: raw[name].rstrip(b"\0").decode() for name in ("serial", "date", "generator", "axes")
    }
    return Identity(
        serial=texts["serial"],
        date=texts["date"],
        inputs_sha256=raw["inputs"].hex(),
        generator=texts["generator"],
        axes=texts["axes"],
        degc_per_code=struct.unpack("<d", raw["degc_per_code"])[0],
        degc_at_zero=struct.unpack("<d", raw["degc_at_zero"])[0],
    )
