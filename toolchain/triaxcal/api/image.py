"""`read_image`, `CalibrationImage`: a file of constants, and files to flash it with."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from triaxcal.base.errors import refused_by_system
from triaxcal.base.publish import renew
from triaxcal.codegen.flashfile import Placed, flash_file
from triaxcal.codegen.image_parts import ImagePart, image_parts
from triaxcal.report.image import image_text


@dataclass(frozen=True)
class CalibrationImage:
    """A file of constants for flash, whose CRCs are correct. Made by `read_image`.

    Attributes
    ----------
    source : str
        The file.
    content : bytes
        Its bytes, without erased flash behind them.
    parts : tuple of ImagePart
        The constants of the accelerometer; of an IMU the gyro's as well. Each has its `triad`,
        `shape`, and `identity`: `serial`, `date`, `inputs_sha256`, `generator`, `axes`,
        `degc_per_code`, `degc_at_zero`, or None in a file of triaxcal 0.1.0.
    summary : str
        The text that the command line prints.
    """

    source: str
    content: bytes = field(repr=False)
    parts: tuple[ImagePart, ...]
    summary: str = field(repr=False)

    def __str__(self) -> str:
        return self.summary

    def write(
        self,
        path: str | Path,
        address: int | None = None,
        *,
        size: int | None = None,
        family: int | None = None,
    ) -> Path:
        """Write a file that production flashes; its ending says its format.

        Parameters
        ----------
        path : path
            Ends in .hex (Intel HEX), .srec (Motorola, 32-bit addresses), .uf2, or .bin (padded).
        address : int or None
            Address of the first byte in flash: a multiple of 4, in UF2 of 256. A .bin has none.
        size : int or None
            Bytes of flash that are reserved; refused when the constants do not fit. A .bin is
            filled up to it with 0xFF.
        family : int or None
            Family of the board, for UF2.

        Raises
        ------
        RefusedError
            For another ending, an address or a size that does not fit, or a missing package.
        """
        target = Path(path)
        content = flash_file(str(target), Placed(self.content, address, size, family))
        renew({target.name: content}, target.parent)
        return target


def read_image(path: str | Path) -> CalibrationImage:
    """A triax_calib.bin, or the triax_imu.bin of an IMU; erased flash behind it does no harm.

    Raises
    ------
    RefusedError
        When the file cannot be read, is no image, or is cut or damaged.
    """
    source = Path(path)
    try:
        content = source.read_bytes()
    except OSError as error:
        raise refused_by_system(source, "read", error, expected="a triax_calib.bin") from error
    parts = image_parts(content, str(source))
    text = image_text(source.name, content, parts)
    return CalibrationImage(str(source), content[: parts[-1].at + parts[-1].size], parts, text)
