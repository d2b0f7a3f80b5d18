"""RISC-V of 32 bits with multiplication."""

from triaxcal.targets.cores.core import SEMIHOSTING, Core

ENTRY = Core(
    "RV32IM",
    "RV32IM",
    "RISC-V RV32IM as the machine virt of QEMU.",
    "riscv64-unknown-elf-gcc",
    "riscv32-unknown-elf",
    ("-march=rv32im", "-mabi=ilp32"),
    ("qemu-system-riscv32", "-M", "virt", "-bios", "none", *SEMIHOSTING, "-kernel"),
    {"RAM_ORIGIN": 0x80000000, "RAM_LENGTH": 16 * 1024 * 1024},
    high_multiply=True,
    rank=6,
)
