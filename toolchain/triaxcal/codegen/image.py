"""The binary image triax_calib.bin: 32-bit little-endian words and a CRC-32.

magic "TRXC", version, size in bytes, twelve words of shape,
temp_min_code, temp_max_code,
a segment: first_code, origin_code, gain, 12 x (order + 1) coefficients, constant first,
with terms beyond the linear ones (version 2) a thirteenth word of shape says which, and here stand
    quadratic: 3 x 6 words
    dT/dt: rate_min, rate_max, rate_gain, 3 words
    g-sensitivity of a gyro, whose magic is "TRXG": 3 x 3 words
(sums of high words have that word too, and nothing here)
CRC-32 (IEEE 802.3) of all before it.
"""

from __future__ import annotations

import struct
import zlib

from triaxcal.fixedpoint.plan import Plan
from triaxcal.model.methods.method import DIRECT

MAGIC = int.from_bytes(b"TRXC", "little")
VERSION, VERSION_WITH_TERMS = 1, 2
GYRO_MAGIC = int.from_bytes(b"TRXG", "little")
QUADRATIC, RATE, SENSITIVITY, HIGH_WORDS = 1, 2, 4, 8
"""Bits of the word that says which terms there are, and how products are summed."""
FORCE_Q_SHIFT = 8
"""Of a gyro, where that word has the Q of the specific force that it takes."""
HEADER_NAMES = (
    "magic TRXC",
    "version of the layout",
    "size in bytes",
    "form: 0 direct, 1 inverse",
    "segments",
    "order",
    "output Q",
    "output shift",
    "raw code min",
    "raw code max",
    "raw shift",
    "adjugate shift",
    "determinant shift",
    "log2 of the reciprocal",
    "gain shift",
)
TERMS_NAME = "terms: 1 quadratic, 2 dT/dt, 4 g-sensitivity, force Q << 8"
HIGH_WORDS_NAME = "terms: 2 dT/dt; 8 sums of high words"


def terms_word(plan: Plan) -> int:
    """Which terms there are beyond the linear ones, and whether sums are of high words."""
    if plan.sensitivity is not None:
        return SENSITIVITY | plan.force_q << FORCE_Q_SHIFT
    quadratic = QUADRATIC if plan.quadratic is not None else 0
    rate = RATE if plan.rate is not None else 0
    return quadratic | rate | (HIGH_WORDS if plan.shape.high_words else 0)


def header_names(plan: Plan) -> tuple[str, ...]:
    """What each of the first words is."""
    if plan.shape.high_words:
        return (*HEADER_NAMES, HIGH_WORDS_NAME)
    names = (*HEADER_NAMES, TERMS_NAME) if terms_word(plan) else HEADER_NAMES
    return ("magic TRXG", *names[1:]) if plan.shape.gyro else names


def header_words(plan: Plan) -> list[int]:
    """First words of the image, each 0 to 2^32 - 1, in the order of `header_names`."""
    shape = plan.shape
    inverse = shape.inverse
    shifts = (
        (0, 0, 0, 0)
        if inverse is None
        else (
            inverse.adjugate_shift,
            inverse.determinant_shift,
            inverse.reciprocal_log2,
            inverse.gain_shift,
        )
    )
    terms = terms_word(plan)
    words = [
        GYRO_MAGIC if shape.gyro else MAGIC,
        VERSION_WITH_TERMS if terms else VERSION,
        image_size(plan),
        0 if shape.form == DIRECT else 1,
        shape.segments,
        shape.order,
        shape.output_q,
        shape.output_shift,
        shape.raw_min,
        shape.raw_max,
        shape.raw_shift,
        *shifts,
        *([terms] if terms else []),
    ]
    return [w % 2**32 for w in words]


def image_size(plan: Plan) -> int:
    """Bytes of the image."""
    shape = plan.shape
    segment_words = 3 + 12 * (shape.order + 1)
    words = len(header_names(plan)) + 2 + shape.segments * segment_words + 1
    return 4 * (words + len(_term_words(plan)))


def _term_words(plan: Plan) -> list[int]:
    """Words of the terms, as they stand before the CRC."""
    tables = [t for t in (plan.quadratic, plan.sensitivity) if t is not None]
    words: list[int] = [word for table in tables for word in table.ravel().tolist()]
    if plan.rate is not None:
        rate = plan.rate
        words += [rate.min_code, rate.max_code, rate.gain, *rate.words.tolist()]
    return words


def constant_words(plan: Plan) -> list[int]:
    """The constants, each an int32, in the order of the image and of the structure in the C."""
    words = [plan.temp_min_code, plan.temp_max_code]
    for segment in plan.segments:
        words += [segment.first_code, segment.origin_code, segment.gain]
        words += segment.coefficients.ravel().tolist()
    return words + _term_words(plan)


def image_bytes(plan: Plan) -> bytes:
    """Render the image of a plan."""
    words = [*header_words(plan), *constant_words(plan)]
    payload = struct.pack(f"<{len(words)}I", *(w % 2**32 for w in words))
    return payload + struct.pack("<I", zlib.crc32(payload))
