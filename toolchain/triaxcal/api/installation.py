"""`installation`: what is installed of what triaxcal can use, and what each part is for."""

from __future__ import annotations

import platform
import re
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from importlib import metadata

from triaxcal import __version__
from triaxcal.base.errors import RefusedError
from triaxcal.base.extras import EXTRAS, install_command, pip_command
from triaxcal.base.shipped import shipped
from triaxcal.base.tools import TOOLS, MissingToolError, Tool
from triaxcal.codegen.compiler import library_folder, start_reference
from triaxcal.codegen.compilers import COMPILERS, find_compiler
from triaxcal.codegen.compilers import install_advice as compiler_advice
from triaxcal.report.installation import INSTALLED, Installation, InstalledPart
from triaxcal.rig.sources.candevices import can_devices

_PYTHON = "Programming Language :: Python :: "
_EXTRA = re.compile(r"extra == ['\"]([^'\"]+)['\"]")
_NAME = re.compile(r"[A-Za-z0-9._-]+")
BASE, COMPILER, OPTIONAL = "every command", "C compiler", "optional packages"
PROGRAMS, BUSES = "other programs", "CAN"


def installation() -> Installation:
    """What is installed of what triaxcal can use; the compiler is tried with a library."""
    parts = [_python(), *_base(), *_compilers(), *_optional(), *_programs(), _buses()]
    return Installation(__version__, str(shipped("docs")), tuple(parts))


def _python() -> InstalledPart:
    """Python, and whether it is one of those that triaxcal is tested with."""
    version = platform.python_version()
    try:
        named = metadata.metadata("triaxcal").get_all("Classifier") or []
    except metadata.PackageNotFoundError:
        named = []
    tested = [c.removeprefix(_PYTHON) for c in named if c.startswith(f"{_PYTHON}3.")]
    own = ".".join(map(str, sys.version_info[:2]))
    words = "" if own in tested or not tested else f"; tested with {', '.join(tested)}"
    return InstalledPart(BASE, "Python", version, f"runs triaxcal{words}", needed=True)


def _requirements() -> dict[str, list[str]]:
    """Packages that triaxcal requires, by extra; those of every command by ""."""
    try:
        lines = metadata.requires("triaxcal") or []
    except metadata.PackageNotFoundError:  # started from its folder
        lines = []
    found: dict[str, list[str]] = {}
    for line in lines:
        name, extra = _NAME.match(line), _EXTRA.search(line)
        if name:
            found.setdefault(extra.group(1) if extra else "", []).append(name.group())
    return found


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return ""


def _base() -> list[InstalledPart]:
    return [
        InstalledPart(BASE, name, _version(name), "", pip_command(name), needed=True)
        for name in _requirements().get("", [])
    ]


def _compilers() -> list[InstalledPart]:
    """The compiler that is taken, tried with the reference; then those there are."""
    try:
        compiler = find_compiler()
        with library_folder() as folder:
            start_reference(folder).load()
        found = compiler.version() or INSTALLED
        chosen = InstalledPart(COMPILER, compiler.name, found, "is used, and makes a library")
    except RefusedError as refusal:
        chosen = InstalledPart(COMPILER, "C compiler", "", str(refusal), compiler_advice())
    parts = [replace(chosen, needed=True)]
    others = (find() for name, find in COMPILERS.items() if name != chosen.name)
    more = "is another choice: CC names it"
    return parts + [InstalledPart(COMPILER, o.name, o.version(), more) for o in others if o]


def _optional() -> list[InstalledPart]:
    requirements = _requirements()
    parts = []
    for extra, what_for in EXTRAS.items():
        versions = {name: _version(name) for name in requirements.get(extra, [])}
        missing = [name for name, version in versions.items() if not version]
        found = ", ".join(f"{name} {version}" for name, version in versions.items())
        purpose = f"{what_for}; missing: {', '.join(missing)}" if missing else what_for
        part = InstalledPart(OPTIONAL, extra, found, purpose, install_command(extra))
        parts.append(replace(part, found="") if missing else part)
    return parts


def _programs() -> list[InstalledPart]:
    with ThreadPoolExecutor() as pool:
        return list(pool.map(_program, (t for n, t in TOOLS.items() if n not in COMPILERS)))


def _program(tool: Tool) -> InstalledPart:
    try:
        found = tool.version() or INSTALLED
    except MissingToolError:
        found = ""
    return InstalledPart(PROGRAMS, tool.program, found, tool.purpose, tool.install_command())


def _buses() -> InstalledPart:
    return InstalledPart(
        BUSES,
        "SocketCAN",
        ", ".join(can_devices()),
        "rig, device: the bench over CAN; --bus virtual needs none",
    )
