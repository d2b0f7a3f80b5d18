"""Files that production flashes: bytes at an address as Intel HEX, SREC, UF2, or padded.

Intel HEX and SREC are written by bincopy. UF2 is blocks of 512 bytes with a payload of 256, the
size that its description calls always correct (github.com/microsoft/uf2).
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from triaxcal.base.errors import RefusedError
from triaxcal.base.extras import install_command
from triaxcal.codegen.image_parts import ERASED

_PAYLOAD = 256
_UF2_START = 0x0A324655, 0x9E5D5157
_UF2_END = 0x0AB16F30
_UF2_FAMILY_PRESENT = 0x2000


@dataclass(frozen=True)
class Placed:
    """Bytes at an address of the flash.

    Attributes
    ----------
    content : bytes
    address : int or None
        None for a format that holds none.
    size : int or None
        Bytes that there are for them; None where it is not stated.
    family : int or None
        Family of the board, for UF2.
    """

    content: bytes
    address: int | None = None
    size: int | None = None
    family: int | None = None


def flash_file(name: str, placed: Placed) -> bytes:
    """Content of a file whose format its name's ending says: hex, srec, bin or uf2.

    Raises
    ------
    RefusedError
        For another ending, an address that is missing or does not fit, or a missing package.
    """
    ending = Path(name).suffix.lower().removeprefix(".")
    if ending not in _FORMATS:
        raise RefusedError(
            name,
            f"the ending {ending!r}" if ending else "no ending",
            expected="one of " + ", ".join(_FORMATS),
        )
    if placed.family is not None and ending != "uf2":
        raise RefusedError("family", "stated", expected="a file that ends in .uf2")
    _whole("family", placed.family, 1)
    _whole("size", placed.size, 1)
    _refuse_address(placed, 1 if ending != "uf2" else _PAYLOAD)
    return _FORMATS[ending](placed)


def _refuse_address(placed: Placed, granule: int) -> None:
    """An address that is not aligned, or bytes that do not fit behind it."""
    taken = -(-len(placed.content) // granule) * granule
    if placed.size is not None and taken > placed.size:
        raise RefusedError(
            "size",
            f"found {placed.size} bytes",
            expected=f"at least {taken}, which the file takes",
            remedy="reserve more flash for the constants",
        )
    if placed.address is None:
        return
    _whole("address", placed.address, 0)
    aligned = max(granule, 4)
    if placed.address % aligned:
        why = " in a UF2 file" if granule == _PAYLOAD else ""
        raise RefusedError(
            "address",
            f"found 0x{placed.address:X}",
            expected=f"a multiple of {aligned}{why}",
            remedy=f"take 0x{-(-placed.address // aligned) * aligned:X}",
        )
    end = placed.address + max(taken, placed.size or 0)
    if end > 2**32:
        raise RefusedError(
            "address",
            f"0x{placed.address:X} and {end - placed.address} bytes",
            expected="an end within 32 bits",
        )


def _whole(name: str, value: Any, least: int) -> None:
    if value is None:
        return
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value < 2**32:
        raise RefusedError(
            name, f"found {value!r}", expected=f"a whole number, {least} to 0xFFFFFFFF"
        )


def _address(placed: Placed) -> int:
    if placed.address is None:
        raise RefusedError(
            "address", "not stated", expected="the address of the constants in flash"
        )
    return placed.address


def _bincopy(placed: Placed) -> Any:
    address = _address(placed)
    try:
        import bincopy  # noqa: PLC0415  optional
    except ImportError:
        raise RefusedError(
            "HEX and SREC",
            "missing package: bincopy",
            remedy="install it: " + install_command("production"),
        ) from None
    file = bincopy.BinFile()
    file.add_binary(placed.content, address=address)
    return file


def _hex(placed: Placed) -> bytes:
    return str(_bincopy(placed).as_ihex(16)).encode()


def _srec(placed: Placed) -> bytes:
    file = _bincopy(placed)
    file.execution_start_address = 0  # without it there is no S7, and some programmers wait for one
    return str(file.as_srec(16, 32)).encode()


def _bin(placed: Placed) -> bytes:
    """Padded with erased flash; the address is that of its first byte, and not in it."""
    if placed.size is None:
        raise RefusedError(
            "size",
            "not stated",
            expected="the bytes of flash that the file fills",
            remedy="without padding, flash triax_calib.bin as it is",
        )
    return placed.content.ljust(placed.size, ERASED)


def _uf2(placed: Placed) -> bytes:
    address = _address(placed)
    flags = 0 if placed.family is None else _UF2_FAMILY_PRESENT
    content = placed.content
    payloads = [content[k : k + _PAYLOAD] for k in range(0, len(content), _PAYLOAD)]
    blocks = [
        struct.pack(
            "<8I",
            *_UF2_START,
            flags,
            address + k * _PAYLOAD,
            _PAYLOAD,
            k,
            len(payloads),
            placed.family or 0,
        )
        + payload.ljust(476, ERASED)
        + struct.pack("<I", _UF2_END)
        for k, payload in enumerate(payloads)
    ]
    return b"".join(blocks)


_FORMATS: dict[str, Callable[[Placed], bytes]] = {
    "hex": _hex,
    "srec": _srec,
    "bin": _bin,
    "uf2": _uf2,
}
"""By the ending of the file's name."""
