"""Arm Cortex-M4 with its floating-point unit."""

from triaxcal.targets.cores.core import cortex

ENTRY = cortex(3, "Cortex-M4F", "mps2-an386", "-mfpu=fpv4-sp-d16")
