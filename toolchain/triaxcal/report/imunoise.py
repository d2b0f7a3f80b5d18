"""Noise that the filter of an IMU used: what was stated, and what the recording gave."""

from __future__ import annotations

from typing import Any

from triaxcal.dynamic.calibrate import DynamicResult
from triaxcal.dynamic.noise import noise_section

INDENT = 16 * " "
_USED = {
    "gyro_arw_deg_per_sqrt_h": ("gyros", "deg/√h"),
    "gyro_bias_instability_deg_per_h": ("", "deg/h"),
    "accel_vrw_ug_per_sqrt_hz": ("accelerometers", "µg/√Hz"),
    "accel_bias_instability_ug": ("", "µg"),
}


def noise_document(result: DynamicResult) -> dict[str, Any]:
    """Of calibration.json: each figure, and whether it was stated or is from the recording."""
    return {
        name: {
            "value": getattr(result.noise, name),
            "source": "recording" if name in result.estimated else "stated",
        }
        for name in _USED
    }


def noise_lines(result: DynamicResult) -> list[str]:
    """For the screen: what was not stated, as a [noise] to paste; nothing where all was."""
    if not result.estimated:
        return []
    none = [
        triad
        for triad, name in (
            ("gyros", "gyro_bias_instability_deg_per_h"),
            ("accelerometers", "accel_bias_instability_ug"),
        )
        if name in result.estimated and getattr(result.noise, name) == 0.0
    ]
    shown = [f"{INDENT}{' and '.join(none)}: the recording shows no bias instability"] * bool(none)
    return [
        "noise           not stated in unit.toml, from this recording; to state it:",
        *(INDENT + line for line in noise_section(result.noise, result.estimated)),
        *shown,
    ]


def noise_words(result: DynamicResult) -> str:
    """For a page, in one line."""
    words = []
    for name, (triad, unit) in _USED.items():
        value = f"{getattr(result.noise, name):g} {unit}"
        own = " (from this recording)" if name in result.estimated else ""
        words.append(f"{triad} {value}{own}" if triad else f"bias instability {value}{own}")
    return "; ".join(words)
