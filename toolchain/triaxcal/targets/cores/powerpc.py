"""PowerPC: the big-endian one."""

from triaxcal.targets.cores.core import Core

ENTRY = Core(
    "PowerPC",
    "PowerPC (big-endian)",
    "PowerPC of 32 bits, big-endian, as a Linux program.",
    "powerpc-linux-gnu-gcc",
    "powerpc-linux-gnu",
    (),
    ("qemu-ppc",),
    {},
    hosted=True,
    rank=7,
)
