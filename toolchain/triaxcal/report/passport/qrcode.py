"""A code to scan: whose passport this is, and the hash of the constants that belong to it."""

from __future__ import annotations

import hashlib
import itertools

import segno

from triaxcal.codegen.names import names_of
from triaxcal.report.passport.content import Passport
from triaxcal.report.texts.speaker import Speaker

_QUIET = 4
"""Modules of white around it, ISO/IEC 18004."""


def image_sha256(p: Passport) -> str:
    """Hash of the constants as they lie in flash."""
    file = names_of(p.delivery.plan).file("triax_calib.bin")
    return hashlib.sha256(p.delivery.files[file]).hexdigest()


def qr_text(p: Passport) -> str:
    """What the code holds, a line each: unit, serial number, certificate, hash of the image."""
    unit = p.delivery.unit
    lines = [f"unit {unit.name}", f"serial {unit.serial}"]
    if unit.certificate is not None:
        lines.append(f"certificate {unit.certificate.identifier}")
    return "\n".join([*lines, f"image sha256 {image_sha256(p)}"])


def qr_code(p: Passport, t: Speaker) -> dict[str, object]:
    """Its size in modules, its dark modules as one path, and what it says.

    Error correction of level M: it stays readable with 15 % of it lost.
    """
    code = segno.make(qr_text(p), error="m", micro=False, boost_error=False)
    path = []
    for y, row in enumerate(code.matrix):
        x = 0
        for dark, run in itertools.groupby(row):
            length = len(list(run))
            if dark:
                path.append(f"M{x + _QUIET} {y + _QUIET}h{length}v1h-{length}z")
            x += length
    image = image_sha256(p)
    return {
        "size": len(code.matrix) + 2 * _QUIET,
        "path": "".join(path),
        "alt": t("page.qr", serial=p.delivery.unit.serial, image=image),
    }
