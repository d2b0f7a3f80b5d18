"""A code to scan: whose passport this is, and the hash of the constants that belong to it."""

from __future__ import annotations

import itertools

import segno

from triaxcal.device.record import sha256_of
from triaxcal.report.passport.content import Passport
from triaxcal.report.texts.speaker import Speaker

_QUIET = 4
"""Modules of white around it, ISO/IEC 18004."""
_LONGEST = 200
"""Characters of the certificate's number: the largest code holds no text of any length."""


def qr_text(p: Passport) -> str:
    """What the code holds, a line each: unit, serial number, certificate, hash of the image."""
    unit = p.delivery.unit
    lines = [f"unit {unit.name}", f"serial {unit.serial}"]
    if unit.certificate is not None:
        lines.append(f"certificate {unit.certificate.identifier[:_LONGEST]}")
    return "\n".join([*lines, f"image sha256 {sha256_of(p.image)}"])


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
    return {
        "size": len(code.matrix) + 2 * _QUIET,
        "path": "".join(path),
        "alt": t("page.qr", serial=p.delivery.unit.serial, image=sha256_of(p.image)),
    }
