"""triax_selftest.h and .c: known answers of the unit, for the device to compare with its own."""

from __future__ import annotations

import ctypes
import zlib
from collections.abc import Sequence
from typing import Any

from triaxcal.base.errors import RefusedError
from triaxcal.codegen.constants import Provenance
from triaxcal.codegen.identity import MAGIC, VERSION
from triaxcal.codegen.image import header_words, image_bytes
from triaxcal.codegen.names import names_of
from triaxcal.codegen.render import TERM_TABLES
from triaxcal.codegen.selftest_images import ENTRY_SIZE, SelftestImage, selftest_images
from triaxcal.codegen.selftest_vectors import (
    Vectors,
    answers_of,
    selftest_vectors,
    vector_size,
)
from triaxcal.codegen.templates import int32_literal, render
from triaxcal.fixedpoint.plan import Plan

SELFTEST_FILES = ("triax_selftest.h", "triax_selftest.c")
TABLES_SIZE = 2048
"""Bytes of flash that the tables take at most."""


def render_selftest(plan: Plan, provenance: Provenance) -> dict[str, str]:
    """Texts of `SELFTEST_FILES`, or a gyro's, by name."""
    names = names_of(plan)
    header = header_words(plan)
    vectors = selftest_vectors(plan)
    size = vector_size(plan) * len(vectors) + 4 * len(header)
    images = selftest_images(plan, vectors, TABLES_SIZE - size)
    changes = [change for image in images for change in image.changes]
    context: dict[str, Any] = {
        "shape": plan.shape,
        "serial": provenance.serial,
        **names.unit_context(provenance.inputs_sha256),
        "header": header,
        "identity_magic": MAGIC,
        "identity_version": VERSION,
        "terms": TERM_TABLES[plan.shape.gyro],
        "crc": _hex(zlib.crc32(image_bytes(plan)[:-4])),
        "vectors": _vector_texts(plan, vectors),
        "changes": [_list([c.value, f"{c.first}u", f"{c.count}u"]) for c in changes],
        "images": [{"name": image.name, "text": _image_text(image)} for image in images],
        "tables_size": size + ENTRY_SIZE * (len(images) + len(changes)),
    }
    source = f"shape {names.shape}, inputs sha256 {provenance.inputs_sha256[:16]}"
    return dict(render(name, source, names, **context) for name in SELFTEST_FILES)


def check_selftest(plan: Plan, provenance: Provenance, library: ctypes.CDLL) -> None:
    """Run the self-test of a compiled delivery on this machine.

    Raises
    ------
    RefusedError
        When it fails: the number that it returned.
    """
    names = names_of(plan)
    selftest = getattr(library, f"{names.unit(provenance.inputs_sha256)}_selftest")
    selftest.restype = ctypes.c_uint32
    failed = int(selftest())
    if failed:
        raise RefusedError(
            f"{names.triad}_selftest on this machine",
            f"{failed}",
            expected="0: passed",
            remedy="do not use this build, report it",
        )


def _vector_texts(plan: Plan, vectors: Vectors) -> list[str]:
    results, status = answers_of(plan, vectors)
    texts = []
    for i in range(len(vectors)):
        rate = [int(vectors.rate[i])] if plan.rate is not None else []
        force = [_braces(vectors.force[i].tolist())] if plan.shape.gyro else []
        raw, result = (_braces(codes[i].tolist()) for codes in (vectors.raw, results))
        texts.append(_list([int(vectors.temp[i]), *rate, raw, *force, result, f"{status[i]}u"]))
    return texts


def _image_text(image: SelftestImage) -> str:
    return _list([_hex(image.answers), f"{len(image.changes)}u", f"{image.size}u"])


def _hex(word: int) -> str:
    return f"0x{word:08X}u"


def _braces(values: list[int]) -> str:
    return "{" + _list(values) + "}"


def _list(values: Sequence[int | str]) -> str:
    return ", ".join(v if isinstance(v, str) else int32_literal(v) for v in values)
