"""Arm Cortex-M3."""

from triaxcal.targets.cores.core import cortex

ENTRY = cortex(2, "Cortex-M3", "mps2-an385")
