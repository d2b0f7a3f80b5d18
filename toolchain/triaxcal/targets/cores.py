"""The cores, and the tools that build for them and run them."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from dataclasses import dataclass

PACKAGES = {
    "arm-none-eabi-gcc": "gcc-arm-none-eabi",
    "riscv64-unknown-elf-gcc": "gcc-riscv64-unknown-elf",
    "powerpc-linux-gnu-gcc": "gcc-powerpc-linux-gnu libc6-dev-powerpc-cross",
    "clang": "clang",
    "gcc": "gcc libc6-dev",
    "qemu-system-arm": "qemu-system-arm",
    "qemu-system-riscv32": "qemu-system-misc",
    "qemu-ppc": "qemu-user",
}
"""Debian package of each tool."""

_SEMIHOSTING = (
    "-nographic", "-monitor", "none", "-serial", "none", "-chardev", "stdio,id=out",
    "-semihosting-config", "enable=on,target=native,chardev=out",
)  # fmt: skip


@dataclass(frozen=True)
class Core:
    """One core under emulation.

    Attributes
    ----------
    name : str
        For people.
    gcc : str
        The cross compiler, which also links what clang compiled (it knows its libgcc).
    clang_triple : str
        clang's --target.
    flags : tuple of str
        Of both compilers: core, float ABI.
    emulator : tuple of str
        Command that takes the program's path as its last argument.
    memory : dict
        Origins and lengths for the linker script; empty for a hosted program.
    thumb2_multiply : bool
        Whether it has Thumb-2 with 32x32->64 multiplications, which TRIAX_THUMB2 needs.
    no_long_multiply : bool
        Whether it has no 32x32->64 multiplication, so that TRIAX_LIMBS is meant for it.
    """

    name: str
    gcc: str
    clang_triple: str
    flags: tuple[str, ...]
    emulator: tuple[str, ...]
    memory: dict[str, int]
    thumb2_multiply: bool = False
    no_long_multiply: bool = False

    @property
    def hosted(self) -> bool:
        """Whether it runs a Linux program under qemu-user."""
        return not self.memory

    def tools(self, compiler: str) -> tuple[str, ...]:
        """Programs needed to build with "gcc" or "clang" and to run."""
        compilers = (self.gcc,) if compiler == "gcc" else ("clang", self.gcc)
        return (*compilers, self.emulator[0])


def missing_tools(tools: Iterable[str]) -> list[str]:
    """Those not installed."""
    return [tool for tool in dict.fromkeys(tools) if shutil.which(tool) is None]


def install_advice(tools: Iterable[str]) -> str:
    """The command that installs them on Debian."""
    packages = dict.fromkeys(p for tool in tools for p in PACKAGES[tool].split())
    return "sudo apt-get install " + " ".join(packages)


def _cortex(name: str, cpu: str, machine: str, *fpu: str, flash: int = 0, ram: int = 0x20000000,
            flash_kb: int = 4096, ram_kb: int = 4096, thumb2: bool = True) -> Core:  # fmt: skip
    floats = ("-mfloat-abi=hard", *fpu) if fpu else ("-mfloat-abi=soft",)
    memory = {
        "FLASH_ORIGIN": flash, "FLASH_LENGTH": flash_kb * 1024,
        "RAM_ORIGIN": ram, "RAM_LENGTH": ram_kb * 1024,
    }  # fmt: skip
    return Core(
        name,
        "arm-none-eabi-gcc",
        "arm-none-eabi",
        (f"-mcpu={cpu}", "-mthumb", *floats),
        ("qemu-system-arm", "-M", machine, *_SEMIHOSTING, "-kernel"),
        memory,
        thumb2_multiply=thumb2,
        no_long_multiply=not thumb2,
    )


CORES = (
    _cortex("Cortex-M0", "cortex-m0", "microbit", flash_kb=256, ram_kb=16, thumb2=False),
    _cortex("Cortex-M3", "cortex-m3", "mps2-an385"),
    _cortex("Cortex-M4F", "cortex-m4", "mps2-an386", "-mfpu=fpv4-sp-d16"),
    _cortex("Cortex-M7", "cortex-m7", "mps2-an500", "-mfpu=fpv5-sp-d16"),
    _cortex("Cortex-M33", "cortex-m33", "mps2-an505", "-mfpu=fpv5-sp-d16",
            flash=0x10000000, ram=0x38000000, ram_kb=1024),
    Core(
        "RV32IM",
        "riscv64-unknown-elf-gcc",
        "riscv32-unknown-elf",
        ("-march=rv32im", "-mabi=ilp32"),
        ("qemu-system-riscv32", "-M", "virt", "-bios", "none", *_SEMIHOSTING, "-kernel"),
        {"RAM_ORIGIN": 0x80000000, "RAM_LENGTH": 16 * 1024 * 1024},
    ),
    Core(
        "PowerPC (big-endian)",
        "powerpc-linux-gnu-gcc",
        "powerpc-linux-gnu",
        (),
        ("qemu-ppc",),
        {},
    ),
)  # fmt: skip
"""Every core of the matrix; the last is big-endian."""
