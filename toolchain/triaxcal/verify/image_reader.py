"""The delivered image read back: the integers that the checks reason about.

Written from the layout in docs/explanation/fixed-point.md and not from the writer, so that a
mistake of the writer shows.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass

from triaxcal.base.errors import RefusedError

HEADER_WORDS = 15
FUNCTIONS = 12


@dataclass(frozen=True)
class ImageSegment:
    """A segment: codes first_code to last_code, x = (code - origin_code) * gain."""

    first_code: int
    last_code: int
    origin_code: int
    gain: int
    coefficients: tuple[tuple[int, ...], ...]


@dataclass(frozen=True)
class Image:
    """What an image holds; shifts of the inverse form are left out.

    `rate` is rate_min, rate_max, rate_gain and the three words.
    """

    inverse_form: bool
    order: int
    output_shift: int
    raw_min: int
    raw_max: int
    raw_shift: int
    segments: tuple[ImageSegment, ...]
    quadratic: tuple[tuple[int, ...], ...] = ()
    rate: tuple[int, ...] = ()
    sensitivity: tuple[tuple[int, ...], ...] = ()
    high_words: bool = False


def image_length(image: bytes) -> int:
    """Bytes of the image that `image` begins with, as its header says; an IMU's has two."""
    length: int = struct.unpack_from("<i", image, 8)[0]
    return length


def read_image(image: bytes) -> Image:
    """Read an image.

    Raises
    ------
    RefusedError
        When its size or its CRC is wrong.
    """
    if len(image) % 4 or len(image) < 4 * (HEADER_WORDS + 3):
        raise RefusedError(
            "image", f"{len(image)} bytes", expected="whole words, a header at least"
        )
    words = struct.unpack(f"<{len(image) // 4}i", image)
    if words[2] != len(image) or words[-1] % 2**32 != zlib.crc32(image[:-4]):
        raise RefusedError("image", "size or CRC is wrong", remedy="write it again")
    form, segments, order, _, output_shift, raw_min, raw_max, raw_shift = words[3:11]
    step = 3 + FUNCTIONS * (order + 1)
    # Version 2 has a word more: which terms there are.
    header = HEADER_WORDS + words[1] - 1
    terms = words[HEADER_WORDS] if words[1] == 2 else 0
    starts = [header + 2 + s * step for s in range(segments)]
    lasts = [words[start] - 1 for start in starts[1:]] + [words[header + 1]]
    at_terms = header + 2 + segments * step
    quadratic = _table(words[at_terms:], 6) if terms & 1 else ()
    at_rate = at_terms + (18 if terms & 1 else 0)
    rate = words[at_rate : at_rate + 6] if terms & 2 else ()
    sensitivity = _table(words[at_terms:], 3) if terms & 4 else ()
    return Image(
        bool(form), order, output_shift, raw_min, raw_max, raw_shift,
        tuple(_segment(words[at : at + step], last, order)
              for at, last in zip(starts, lasts, strict=True)),
        quadratic, rate, sensitivity, bool(terms & 8),
    )  # fmt: skip


def _table(words: tuple[int, ...], columns: int) -> tuple[tuple[int, ...], ...]:
    return tuple(words[columns * i : columns * (i + 1)] for i in range(3))


def _segment(words: tuple[int, ...], last_code: int, order: int) -> ImageSegment:
    first_code, origin_code, gain = words[:3]
    terms = order + 1
    rows = tuple(words[3 + f * terms : 3 + (f + 1) * terms] for f in range(FUNCTIONS))
    return ImageSegment(first_code, last_code, origin_code, gain, rows)
