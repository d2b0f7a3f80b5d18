"""Arm Cortex-M0: no 32x32->64 multiplication."""

from triaxcal.targets.cores.core import cortex

ENTRY = cortex(1, "Cortex-M0", "microbit", flash_kb=256, ram_kb=16, thumb2=False)
