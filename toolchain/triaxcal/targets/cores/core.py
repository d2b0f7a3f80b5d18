"""What a core is: how to build for it and how to run it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

SEMIHOSTING = (
    "-nographic", "-monitor", "none", "-serial", "none", "-chardev", "stdio,id=out",
    "-semihosting-config", "enable=on,target=native,chardev=out",
)  # fmt: skip

COMPILERS = ("gcc", "clang")
VECTORS = 24576


def _output(output: str, _errors: str) -> str:
    return output


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
        Origins and lengths for the linker script; empty where the toolchain brings start-up code
        and script of its own.
    thumb2_multiply : bool
        Whether it has Thumb-2 with 32x32->64 multiplications, which TRIAX_THUMB2 needs.
    no_long_multiply : bool
        Whether it has no 32x32->64 multiplication, so that TRIAX_LIMBS is meant for it.
    high_multiply : bool
        Whether an instruction gives the high word of a product alone, and none adds to 64 bits:
        for sums of high words.
    thumb1_multiply : bool
        Whether TRIAX_THUMB1 is meant for it.
    hosted : bool
        Whether it runs a Linux program under qemu-user.
    compilers : tuple of str
        Those that can build for it.
    vectors : int
        How many vectors it runs through each routine.
    printed : callable
        What the program printed, from standard output and standard error of its emulator.
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
    high_multiply: bool = False
    thumb1_multiply: bool = False
    hosted: bool = False
    compilers: tuple[str, ...] = COMPILERS
    vectors: int = VECTORS
    printed: Callable[[str, str], str] = _output
    rank: int = 100

    @property
    def counted(self) -> bool:
        """Whether the plugin of QEMU counts its instructions: what runs bare metal under QEMU."""
        return bool(self.memory)

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
        thumb1_multiply=not thumb2,
        rank=rank,
    )
