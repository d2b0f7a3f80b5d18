"""What a file of constants holds, in words."""

from __future__ import annotations

from triaxcal.codegen.identity import Identity
from triaxcal.codegen.image_parts import ImagePart


def image_text(name: str, content: bytes, parts: tuple[ImagePart, ...]) -> str:
    """Lines about each triad in a file."""
    taken = parts[-1].at + parts[-1].size
    padding = len(content) - taken
    size = f"{taken} bytes" + (f", and {padding} of erased flash" if padding else "")
    rows: list[tuple[str, str]] = []
    for part in parts:  # a gyro's identity differs in its axes alone
        rows += [row for row in _identity(part.identity) if row not in rows]
        rows += _constants(part)
    lines = [f"  {key:<15} {value}" for key, value in rows]
    return "\n".join([f"{name}: {size}; every CRC is correct", *lines])


def _identity(identity: Identity | None) -> list[tuple[str, str]]:
    if identity is None:
        return [("identity", "none: written by triaxcal 0.1.0, or cut behind the constants")]
    per_code, at_zero = identity.degc_per_code, identity.degc_at_zero
    return [
        ("serial number", identity.serial),
        ("measured", identity.date or "date not stated"),
        ("inputs sha256", identity.inputs_sha256),
        ("generator", f"triaxcal {identity.generator}"),
        ("axes", identity.axes or "outputs x, y, z"),
        ("temperature", f"{per_code:.9g} degC per code, {at_zero:.9g} degC at code 0"),
    ]


def _constants(part: ImagePart) -> list[tuple[str, str]]:
    low, high = part.temp_codes
    found = f"temperature codes {low} to {high}"
    if part.identity is not None:
        per_code, at_zero = part.identity.degc_per_code, part.identity.degc_at_zero
        ends = [code * per_code + at_zero for code in (low, high)]
        found = f"{ends[0]:g} to {ends[1]:g} degC, codes {low} to {high}"
    where = f"{part.constants_size} bytes from byte {part.at}"
    return [("constants", f"{part.triad}, shape {part.shape}, {where}"), ("range", found)]
