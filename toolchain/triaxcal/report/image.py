"""What a file of constants holds, in words."""

from __future__ import annotations

from triaxcal.codegen.identity import Identity
from triaxcal.codegen.image_parts import ImagePart


def image_text(name: str, content: bytes, parts: tuple[ImagePart, ...]) -> str:
    """Lines about each triad in a file."""
    taken = parts[-1].at + parts[-1].size
    padding = len(content) - taken
    size = f"{taken} bytes" + (f", and {padding} of erased flash" if padding else "")
    blocks = [f"{name}: {size}; every CRC is correct"]
    blocks += ["\n".join(f"  {key:<15} {value}" for key, value in _rows(part)) for part in parts]
    return "\n".join(blocks)


def _rows(part: ImagePart) -> list[tuple[str, str]]:
    low, high = part.temp_codes
    constants = f"{part.constants_size} bytes from byte {part.at}"
    rows = [("constants", f"{part.triad}, shape {part.shape}, {constants}")]
    if part.identity is None:
        return [
            *rows,
            ("range", f"temperature codes {low} to {high}"),
            ("identity", "none: written by triaxcal 0.1.0"),
        ]
    scale = part.identity.degc_per_code, part.identity.degc_at_zero
    ends = [code * scale[0] + scale[1] for code in (low, high)]
    return [
        *_identity(part.identity),
        *rows,
        ("temperature", f"{scale[0]:.9g} degC per code, {scale[1]:.9g} degC at code 0"),
        ("range", f"{ends[0]:g} to {ends[1]:g} degC, codes {low} to {high}"),
    ]


def _identity(identity: Identity) -> list[tuple[str, str]]:
    return [
        ("serial number", identity.serial),
        ("measured", identity.date or "date not stated"),
        ("inputs sha256", identity.inputs_sha256),
        ("generator", f"triaxcal {identity.generator}"),
        ("axes", identity.axes or "outputs x, y, z"),
    ]
