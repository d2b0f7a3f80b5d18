"""Arm Cortex-M7."""

from triaxcal.targets.cores.core import cortex

ENTRY = cortex(4, "Cortex-M7", "mps2-an500", "-mfpu=fpv5-sp-d16")
