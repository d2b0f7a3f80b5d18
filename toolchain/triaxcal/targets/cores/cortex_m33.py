"""Arm Cortex-M33."""

from triaxcal.targets.cores.core import cortex

ENTRY = cortex(
    5, "Cortex-M33", "mps2-an505", "-mfpu=fpv5-sp-d16",
    flash=0x10000000, ram=0x38000000, ram_kb=1024,
)  # fmt: skip
