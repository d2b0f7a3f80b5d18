"""Where the shipped files lie: in the wheel, or beside toolchain/ in a checkout."""

from __future__ import annotations

from pathlib import Path


def shipped(name: str) -> Path:
    """Folder `name` ("templates" or "firmware_ref") that came with this triaxcal."""
    package = Path(__file__).resolve().parents[1]
    in_wheel = package / "_shipped" / name
    return in_wheel if in_wheel.is_dir() else package.parents[1] / name
