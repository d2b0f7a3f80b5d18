"""What a rig says of itself, against what the unit and the plan say."""

from __future__ import annotations

import re
import zlib

from triaxcal.base.errors import RefusedError
from triaxcal.unit.description import UnitDescription

_LAST_NUMBER = re.compile(r"[0-9]+(?=[^0-9]*$)")


def serial_crc(serial: str) -> int:
    """CRC-32 of a serial number's text, as the tilter sends it."""
    return zlib.crc32(serial.encode("ascii"))


def sent_serial(kind: str, serial: str) -> int | None:
    """Number that a unit of this serial number sends; None where the text has none.

    Parameters
    ----------
    kind : str
        "crc32" or "number", as serial_is of rig.toml.
    """
    if kind == "crc32":
        return serial_crc(serial)
    found = _LAST_NUMBER.search(serial)
    return int(found[0]) if found else None


def serial_of(kind: str, unit: UnitDescription) -> int:
    """Number that the unit sends.

    Raises
    ------
    RefusedError
        When its serial number has no number in it.
    """
    number = sent_serial(kind, unit.serial)
    if number is None:
        raise RefusedError(
            f"{unit.source}, serial",
            f'"{unit.serial}" has no number in it',
            expected="a number at its end: the rig sends one",
            remedy='or serial_is = "crc32" in rig.toml',
        )
    return number


def sent_words(kind: str, number: int) -> str:
    """A number that a rig sends, as messages name it."""
    return f"0x{number:08X}" if kind == "crc32" else str(number)
