"""The programs that triaxcal can start: what each is for, and the command that installs it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

NO_CONSOLE = getattr(subprocess, "CREATE_NO_WINDOW", 0)
"""For Windows: a notebook has no console, and gets none for each program that is started."""
_ANSWER_S = 20
"""Within this a program says its version."""
_APT = "sudo apt-get install"
_DEBIAN = Path("/usr/bin/apt-get")
_BY_SYSTEM = {"darwin": "brew install", "win32": "choco install"}


class MissingToolError(Exception):
    """A tool is not installed; the text names it and the command that installs it."""


@dataclass(frozen=True)
class Tool:
    """A program.

    Attributes
    ----------
    program : str
        As it is called.
    package : str
        The Debian packages that bring it.
    purpose : str
        What triaxcal does with it.
    version_flag : str
        With it the program prints its version; "" where it prints none.
    elsewhere : dict
        The packages of Homebrew ("darwin") and Chocolatey ("win32"), where they are known.
    """

    program: str
    package: str
    purpose: str
    version_flag: str = "--version"
    elsewhere: Mapping[str, str] = field(default_factory=dict)

    def find(self) -> str:
        """Path of the program.

        Raises
        ------
        MissingToolError
            When it is not installed.
        """
        found = shutil.which(self.program)
        if found is None:
            raise MissingToolError(f"{self.program} not found; {self.install_command()}")
        return found

    def version(self) -> str:
        """First line of what it says about its version; "" where it says none.

        Raises
        ------
        MissingToolError
            When it is not installed.
        """
        found = self.find()
        return version_of((found, self.version_flag)) if self.version_flag else ""

    def install_command(self, platform: str = sys.platform) -> str:
        """Command that installs it on a system; only what to look for where none is known."""
        if platform in _BY_SYSTEM:
            known = self.elsewhere.get(platform)
            return f"{_BY_SYSTEM[platform]} {known}" if known else f"look for {self.program}"
        if not _DEBIAN.exists():
            return f"look for {self.program}; Debian's packages are {self.package}"
        return f"{_APT} {self.package}"


_GCC = "compiles the C of a unit for the cross-check"
_PROOF = "verify: proves the error bound a second time"
_WP = "verify: proves that the C is its specification, with frama-c"
_CORE = "target: the C on another core"
_QEMU = "target: runs the C of another core"
_LLVM = {"darwin": "llvm"}
_QEMU_ELSEWHERE = {"darwin": "qemu", "win32": "qemu"}

_TOOLS = (
    Tool("gcc", "gcc libc6-dev", _GCC, elsewhere={"darwin": "gcc", "win32": "mingw"}),
    Tool("clang", "clang libclang-rt-dev", f"{_GCC}; verify: sanitizers", elsewhere=_LLVM),
    Tool("gappa", "gappa", _PROOF),
    Tool("coqc", "coq libcoq-gappa libcoq-flocq", "certify: checks the proof of the bound"),
    Tool("frama-c", "frama-c-base", "verify: no undefined behaviour in the C", "-version"),
    Tool("why3", "why3", _WP),
    Tool("cvc4", "cvc4", _WP),
    Tool("z3", "z3", _WP),
    Tool(
        "cppcheck", "cppcheck", "verify: rules of MISRA C",
        elsewhere={"darwin": "cppcheck", "win32": "cppcheck"},
    ),
    Tool("arm-none-eabi-gcc", "gcc-arm-none-eabi", _CORE, elsewhere={"win32": "gcc-arm-embedded"}),
    Tool("riscv64-unknown-elf-gcc", "gcc-riscv64-unknown-elf", _CORE),
    Tool("powerpc-linux-gnu-gcc", "gcc-powerpc-linux-gnu libc6-dev-powerpc-cross", _CORE),
    Tool("s390x-linux-gnu-gcc", "gcc-s390x-linux-gnu libc6-dev-s390x-cross", _CORE),
    Tool("avr-gcc", "gcc-avr avr-libc", _CORE),
    Tool("qemu-system-arm", "qemu-system-arm", _QEMU, elsewhere=_QEMU_ELSEWHERE),
    Tool("qemu-system-riscv32", "qemu-system-misc", _QEMU, elsewhere=_QEMU_ELSEWHERE),
    Tool("qemu-ppc", "qemu-user", _QEMU),
    Tool("qemu-s390x", "qemu-user", _QEMU),
    Tool("simavr", "simavr", "target: runs the C of an AVR", ""),
)  # fmt: skip
TOOLS = {tool.program: tool for tool in _TOOLS}
"""Every program, by its name."""


def missing_tools(programs: Iterable[str]) -> list[str]:
    """Those not installed."""
    return [name for name in dict.fromkeys(programs) if shutil.which(name) is None]


def install_advice(programs: Iterable[str]) -> str:
    """The command that installs them on Debian."""
    packages = dict.fromkeys(p for name in programs for p in TOOLS[name].package.split())
    return f"{_APT} {' '.join(packages)}"


def version_of(command: Sequence[str]) -> str:
    """First line that a command prints, in English; "" where it cannot be run or hangs."""
    try:
        done = subprocess.run(
            command, stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace",
            env={**os.environ, "LC_ALL": "C.UTF-8"}, timeout=_ANSWER_S, check=False,
            creationflags=NO_CONSOLE,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return (done.stdout + done.stderr).strip().partition("\n")[0]
