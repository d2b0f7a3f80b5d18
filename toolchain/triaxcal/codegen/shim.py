"""Headers of the default names for C that has a prefix: our own C files call it by those."""

from __future__ import annotations

from pathlib import Path

from triaxcal.unit.prefix import DEFAULT_PREFIX

_HEADERS = (
    "comp.h", "calib.h", "selftest.h", "gyro_comp.h", "gyro_calib.h", "gyro_selftest.h", "imu.h",
    "angles.h",
)  # fmt: skip
_TRIADS = ("", "gyro_", "imu_")
_NAMES = (
    "calib_t", "state_t", "set_temperature", "set_temperature_rate", "apply", "calib_load",
    "selftest", "angles", "angle_t",
)  # fmt: skip
_MACROS = ("CALIB", "IMAGE_SIZE", "RAW_MIN", "RAW_MAX", "RATE_Q", "SHAPE", "TWO_THERMOMETERS")


def write_shim(folder: Path, prefix: str) -> tuple[Path, ...]:
    """Write headers of the default names, which include those of `prefix`.

    Returns
    -------
    tuple of Path
        `folder`, to be searched for headers; nothing where the prefix is the default.
    """
    if prefix == DEFAULT_PREFIX:
        return ()
    folder.mkdir(exist_ok=True)
    names = [f"{triad}{name}" for triad in _TRIADS for name in _NAMES]
    renamed = [f"#define {DEFAULT_PREFIX}_{name} {prefix}_{name}" for name in names]
    for macro in (f"{triad.upper()}{name}" for triad in _TRIADS for name in _MACROS):
        own = f"{prefix.upper()}_{macro}"
        # Some macros are defined in some shapes only.
        renamed += [f"#ifdef {own}", f"#define {DEFAULT_PREFIX.upper()}_{macro} {own}", "#endif"]
    for header in _HEADERS:
        text = "\n".join([f'#include "{prefix}_{header}"', *renamed])
        (folder / f"{DEFAULT_PREFIX}_{header}").write_text(f"{text}\n", encoding="utf-8")
    return (folder,)
