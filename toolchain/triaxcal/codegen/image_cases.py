"""Images that the loader must accept or refuse, at and just beyond every limit of step R.

What is accepted is decided in `image_layout`, not by the code that plans or proves. Accepted
images, however wild their constants, must give the same answers in the generated C and in the
reference C.
"""

from __future__ import annotations

import itertools
import struct
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.codegen.constants import Provenance
from triaxcal.codegen.identity import with_identity
from triaxcal.codegen.image import QUADRATIC, RATE, SENSITIVITY, header_names, terms_word
from triaxcal.codegen.image_edges import image_edges
from triaxcal.codegen.image_layout import INT32_MAX, INT32_MIN, Layout
from triaxcal.codegen.routines import Generated, Reference, difference
from triaxcal.fixedpoint.integer_model import STATUS_BAD_IMAGE, STATUS_OK
from triaxcal.fixedpoint.plan import Plan
from triaxcal.model.methods.method import INVERSE
from triaxcal.unit.thermometer import TemperatureSensor

QUADRATIC_LIMIT, SENSITIVITY_LIMIT = 2**31 - 1, 2**29
_TABLES = {0: (0, 0), QUADRATIC: (6, QUADRATIC_LIMIT), SENSITIVITY: (3, SENSITIVITY_LIMIT)}


@dataclass(frozen=True)
class ImageCase:
    """An image and whether the loader has to accept it."""

    name: str
    image: bytes
    accepted: bool


def check_images(
    plan: Plan, cases: Sequence[ImageCase], generated: Generated, reference: Reference
) -> int:
    """Load every case, run the accepted ones, and return how many cases there were.

    Raises
    ------
    RefusedError
        At the first image that is wrongly accepted or refused, or answered in two ways.
    """
    temp, raw = case_vectors(plan)
    for case in cases:
        status, answers = generated.run_image(case.image, temp, raw)
        expected = STATUS_OK if case.accepted else STATUS_BAD_IMAGE
        if status != expected:
            raise RefusedError(
                f"triax_calib_load, image '{case.name}'",
                f"status {status}",
                expected=f"status {expected}",
                remedy="do not use this build, report it",
            )
        if case.accepted:
            differs = difference(answers, reference.routine(case.image)(temp, raw))
            if differs is not None:
                i = differs.first
                raise RefusedError(
                    f"image '{case.name}', temp_code {temp[i]}, raw_code {raw[i].tolist()}",
                    f"generated C gives {differs.found}",
                    expected=differs.expected,
                    remedy="do not use this build, report it",
                )
    return len(cases)


def image_cases(plan: Plan, image: bytes) -> list[ImageCase]:
    """Damaged images, images at the limits of step R, and wild ones."""
    names = header_names(plan)
    layout = layout_of(plan)
    words = list(struct.unpack(f"<{len(image) // 4}i", image))[:-1]
    cases = [ImageCase(name, damaged, False) for name, damaged in _damaged(image, names)]
    cases += _identities(image)
    for name, change in image_edges(layout, words, plan.shape):
        if not all(INT32_MIN <= value <= INT32_MAX for value in change.values()):
            continue  # beyond what a word holds: no image says so
        changed = words.copy()
        for index, value in change.items():
            changed[index] = value
        cases.append(ImageCase(name, _sealed(changed), layout.is_safe(changed)))
    return cases


def layout_of(plan: Plan) -> Layout:
    """Where the words of a plan's image stand."""
    shape, terms = plan.shape, terms_word(plan)
    columns, limit = _TABLES[terms & (QUADRATIC | SENSITIVITY)]
    return Layout(
        len(header_names(plan)), shape.segments, shape.order, shape.form == INVERSE, columns,
        limit, bool(terms & RATE),
    )  # fmt: skip


def _sealed(words: list[int]) -> bytes:
    payload = struct.pack(f"<{len(words)}i", *words)
    return payload + struct.pack("<I", zlib.crc32(payload))


def _damaged(image: bytes, names: Sequence[str]) -> Iterator[tuple[str, bytes]]:
    for size in (0, 4, len(image) - 4, len(image) - 1):
        yield f"cut to {size} bytes", image[:size]
    for more in (1, 4):
        yield f"{more} bytes too long", image + bytes(more)
    for at in range(len(image)):
        yield f"bit of byte {at}", image[:at] + bytes([image[at] ^ 1 << at % 8]) + image[at + 1 :]
    words = list(struct.unpack(f"<{len(image) // 4}i", image))[:-1]
    for at, name in enumerate(names):
        for bit in (1, INT32_MIN):
            yield f"{name}, CRC right", _sealed([*words[:at], words[at] ^ bit, *words[at + 1 :]])


def _identities(image: bytes) -> Iterator[ImageCase]:
    """Files with an identity behind the constants: good, damaged, and of other constants."""
    sensor = TemperatureSensor(1.0 / 64.0, 0.0)
    file = with_identity(
        image, sensor, Provenance("CASE-1", "5A" * 32, (), "2026-03-30", "-Y, X, Z")
    )
    yield ImageCase("with identity", file, True)
    for size in (len(image) + 4, len(file) - 4, len(file) - 1):
        yield ImageCase(f"identity cut to {size} bytes", file[:size], False)
    for more in (1, 4):
        yield ImageCase(f"identity and {more} bytes", file + bytes(more), False)
    for at in range(len(file)):
        damaged = file[:at] + bytes([file[at] ^ 1 << at % 8]) + file[at + 1 :]
        yield ImageCase(f"with identity, bit of byte {at}", damaged, False)
    words = list(struct.unpack(f"<{len(file) // 4}i", file))[:-1]
    start = len(image) // 4
    for word, name in enumerate(("magic", "version", "CRC of the constants")):
        for bit in (1, INT32_MIN):
            at = start + word
            changed = _sealed([*words[:at], words[at] ^ bit, *words[at + 1 :]])
            yield ImageCase(f"{name} of the identity, CRC right", changed, False)


def case_vectors(plan: Plan) -> tuple[np.ndarray, np.ndarray]:
    """Ends and middle of the temperature range and int32's ends x a few raw codes."""
    shape = plan.shape
    middle = (plan.temp_min_code + plan.temp_max_code) // 2
    beside = plan.segments[0].origin_code + 1
    temps = [INT32_MIN, plan.temp_min_code, beside, middle, plan.temp_max_code, INT32_MAX]
    raws = [INT32_MIN, 1, shape.raw_max // 3, shape.raw_max]
    rows = np.array(list(itertools.product(temps, raws, raws, raws)), dtype=np.int32)
    return np.ascontiguousarray(rows[:, 0]), np.ascontiguousarray(rows[:, 1:])
