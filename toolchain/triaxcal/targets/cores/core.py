"""What a core is: how to build for it and how to run it."""

from __future__ import annotations

from dataclasses import dataclass

SEMIHOSTING = (
    "-nographic", "-monitor", "none", "-serial", "none", "-chardev", "stdio,id=out",
    "-semihosting-config", "enable=on,target=native,chardev=out",
)  # fmt: skip


@dataclass(frozen=True)
class Core:
    """One core under emulation.

    Attributes
    ----------
    name, label, doc : str
        For files and tables, for readers, and what it is.
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
    rank : int
        Place among the cores.
    """

    name: str
    label: str
    doc: str
    gcc: str
    clang_triple: str
    flags: tuple[str, ...]
    emulator: tuple[str, ...]
    memory: dict[str, int]
    thumb2_multiply: bool = False
    no_long_multiply: bool = False
    rank: int = 100

    @property
    def hosted(self) -> bool:
        """Whether it runs a Linux program under qemu-user."""
        return not self.memory

    def tools(self, compiler: str) -> tuple[str, ...]:
        """Programs needed to build with "gcc" or "clang" and to run."""
        compilers = (self.gcc,) if compiler == "gcc" else ("clang", self.gcc)
        return (*compilers, self.emulator[0])


def cortex(rank: int, name: str, machine: str, *fpu: str, flash: int = 0, ram: int = 0x20000000,
            flash_kb: int = 4096, ram_kb: int = 4096, thumb2: bool = True) -> Core:  # fmt: skip
    """A Cortex-M on a machine of QEMU, its floating-point unit by compiler flags."""
    floats = ("-mfloat-abi=hard", *fpu) if fpu else ("-mfloat-abi=soft",)
    memory = {
        "FLASH_ORIGIN": flash, "FLASH_LENGTH": flash_kb * 1024,
        "RAM_ORIGIN": ram, "RAM_LENGTH": ram_kb * 1024,
    }  # fmt: skip
    cpu = name.lower().removesuffix("f")
    return Core(
        name,
        name,
        f"Arm {name} as the machine {machine} of QEMU.",
        "arm-none-eabi-gcc",
        "arm-none-eabi",
        (f"-mcpu={cpu}", "-mthumb", *floats),
        ("qemu-system-arm", "-M", machine, *SEMIHOSTING, "-kernel"),
        memory,
        thumb2_multiply=thumb2,
        no_long_multiply=not thumb2,
        rank=rank,
    )
