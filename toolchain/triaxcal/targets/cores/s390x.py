"""IBM Z: 64 bits, big-endian."""

from triaxcal.targets.cores.core import Core

ENTRY = Core(
    "s390x",
    "s390x (big-endian)",
    "IBM Z of 64 bits, big-endian, as a Linux program.",
    "s390x-linux-gnu-gcc",
    "s390x-linux-gnu",
    (),
    ("qemu-s390x",),
    {},
    hosted=True,
    rank=8,
)
