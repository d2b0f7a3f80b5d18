"""What stands in a file of constants: the images in it, their shapes, and whose they are."""

from __future__ import annotations

import zlib
from dataclasses import dataclass

from triaxcal.base.errors import RefusedError
from triaxcal.codegen.identity import IDENTITY_SIZE, Identity, identity_of
from triaxcal.codegen.image import (
    GYRO_MAGIC,
    HEADER_NAMES,
    MAGIC,
    VERSION,
    VERSION_WITH_TERMS,
)

_TRIADS = {MAGIC: "accelerometer", GYRO_MAGIC: "gyro"}
_HEADER_WORDS = {VERSION: len(HEADER_NAMES), VERSION_WITH_TERMS: len(HEADER_NAMES) + 1}
ERASED = b"\xff"
"""A byte of erased flash."""


@dataclass(frozen=True)
class ImagePart:
    """The constants of one triad in a file.

    Attributes
    ----------
    triad : str
        "accelerometer" or "gyro".
    shape : str
        Eight hex digits: the shape of the routine that takes the constants.
    at, constants_size, size : int
        First byte in the file, bytes of the constants, and bytes with the identity behind them.
    temp_codes : tuple of two int
        Temperature codes of the range.
    identity : Identity or None
        None where the file was written by triaxcal 0.1.0.
    """

    triad: str
    shape: str
    at: int
    constants_size: int
    size: int
    temp_codes: tuple[int, int]
    identity: Identity | None


def image_parts(content: bytes, where: str) -> tuple[ImagePart, ...]:
    """The images in a file, in their order; erased flash behind them is no part of them.

    `where` names the file in messages.

    Raises
    ------
    RefusedError
        When the file is no image, cut, or damaged.
    """
    parts: list[ImagePart] = []
    at = 0
    while not parts or content[at:].strip(ERASED):
        parts.append(_part(content, at, where))
        at += parts[-1].size
    return tuple(parts)


def _part(content: bytes, at: int, where: str) -> ImagePart:
    magic, version, size = _words(content, at, 3)
    if magic not in _TRIADS or version not in _HEADER_WORDS:
        raise RefusedError(
            f"{where}, byte {at}",
            f"found {content[at : at + 8].hex(' ') or 'nothing'}",
            expected="TRXC or TRXG and the version 1 or 2",
            remedy="give the triax_calib.bin of a delivery",
        )
    behind = content[at + size :]
    bare = not behind.strip(ERASED) or int.from_bytes(behind[:4], "little") in _TRIADS
    whole = size if bare else size + IDENTITY_SIZE
    identity = identity_of(content[at : at + whole], f"{where}, image")
    header = _HEADER_WORDS[version]
    low, high = _words(content, at + 4 * header, 2, signed=True)
    shape = f"{zlib.crc32(content[at : at + 4 * header]):08x}"
    return ImagePart(_TRIADS[magic], shape, at, size, whole, (low, high), identity)


def _words(content: bytes, at: int, count: int, signed: bool = False) -> list[int]:
    return [
        int.from_bytes(content[k : k + 4], "little", signed=signed)
        for k in range(at, at + 4 * count, 4)
    ]
