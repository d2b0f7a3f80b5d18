"""The cores that there are, and the tools that build for them and run them."""

from __future__ import annotations

import shutil
from collections.abc import Iterable

from triaxcal.base.registry import Registry
from triaxcal.targets.cores.core import Core

CORES = Registry("core", "triaxcal.targets.cores", Core, ("gcc", "emulator"))
PACKAGES = {
    "arm-none-eabi-gcc": "gcc-arm-none-eabi",
    "riscv64-unknown-elf-gcc": "gcc-riscv64-unknown-elf",
    "powerpc-linux-gnu-gcc": "gcc-powerpc-linux-gnu libc6-dev-powerpc-cross",
    "avr-gcc": "gcc-avr avr-libc",
    "s390x-linux-gnu-gcc": "gcc-s390x-linux-gnu libc6-dev-s390x-cross",
    "clang": "clang",
    "gcc": "gcc libc6-dev",
    "qemu-system-arm": "qemu-system-arm",
    "qemu-system-riscv32": "qemu-system-misc",
    "qemu-ppc": "qemu-user",
    "qemu-s390x": "qemu-user",
    "simavr": "simavr",
}
"""Debian package of each tool."""


def missing_tools(tools: Iterable[str]) -> list[str]:
    """Those not installed."""
    return [tool for tool in dict.fromkeys(tools) if shutil.which(tool) is None]


def install_advice(tools: Iterable[str]) -> str:
    """The command that installs them on Debian."""
    packages = dict.fromkeys(p for tool in tools for p in PACKAGES[tool].split())
    return "sudo apt-get install " + " ".join(packages)
