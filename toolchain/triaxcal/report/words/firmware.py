"""What a page states about the firmware's files: bounds, vectors, tools, hashes."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any

from triaxcal.codegen.crosscheck import CrossCheck
from triaxcal.fixedpoint.proof import Bound
from triaxcal.report.words.numbers import thousands


def proven_words(bound: Bound, check: CrossCheck, size: str) -> str:
    """The proven error of a triad; `size` is what it is in physical units."""
    return (
        f"≤ {bound.lsb:.3f} LSB = {size} at every one of "
        f"{thousands(bound.codes)} temperature codes and any raw code; "
        f"largest seen {check.largest_error_lsb:.3f} LSB"
    )


def checked_words(check: CrossCheck) -> str:
    """The vectors on which three implementations agreed."""
    sets = "; ".join(f"{thousands(count)} {name}" for name, count in check.vectors.items())
    return (
        f"{thousands(check.total)} vectors ({sets}): Python = reference C = generated C, "
        "bit for bit, no mismatch"
    )


def tool_rows(tools: Mapping[str, Any], prefix: str = "") -> list[dict[str, str]]:
    """Rows of a section "tools" of verification.json."""
    return [
        {
            "name": f"{prefix}{name}",
            "result": str(entry["result"]),
            "finding": str(entry["finding"]),
        }
        for name, entry in tools.items()
    ]


def theorem_rows(tools: Mapping[str, Any]) -> list[dict[str, str]]:
    """Names and hashes of the theorems that Coq accepted, from a section of entries."""
    accepted = tools.get("coq", {}).get("sha256", {})
    return [{"name": f"certificates/{file}", "sha256": sha256} for file, sha256 in accepted.items()]


def file_rows(files: Mapping[str, bytes]) -> list[dict[str, str]]:
    """Names and hashes."""
    return [
        {"name": name, "sha256": hashlib.sha256(content).hexdigest()}
        for name, content in files.items()
    ]
