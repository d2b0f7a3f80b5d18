"""What a result was made by: triaxcal to the last byte, what was added, libraries, compiler."""

from __future__ import annotations

import hashlib
import sys
from functools import cache
from importlib import metadata
from pathlib import Path

from triaxcal import __version__
from triaxcal.base.shipped import shipped
from triaxcal.codegen.compilers import find_compiler
from triaxcal.codegen.outputs.registry import OUTPUTS
from triaxcal.model.methods.registry import METHODS
from triaxcal.model.thermal.registry import THERMAL_FUNCTIONS
from triaxcal.readings.format import FORMATS

_REGISTRIES = (THERMAL_FUNCTIONS, METHODS, OUTPUTS, FORMATS)


def toolchain() -> str:
    """Version and 16 hex digits; equal where equal inputs give equal files.

    Raises
    ------
    RefusedError
        When there is no compiler.
    """
    return _toolchain(tuple(_entry(e) for r in _REGISTRIES for e in r))


def _entry(entry: object) -> tuple[str, ...]:
    """Name of an entry, and the files outside of the package that its functions are from."""
    modules = {getattr(value, "__module__", "") for value in vars(entry).values()}
    added = {m for m in modules if m and m.partition(".")[0] != "triaxcal"}
    files = {getattr(sys.modules.get(m), "__file__", None) or "" for m in added}
    return str(vars(entry)["name"]), *sorted(files)


@cache
def _toolchain(entries: tuple[tuple[str, ...], ...]) -> str:
    digest = hashlib.sha256()
    package = Path(__file__).resolve().parents[1]
    for root, pattern in (
        (package, "*.py"),
        (shipped("templates"), "*.j2"),
        (shipped("firmware_ref"), "triax_*"),
    ):
        for path in sorted(root.rglob(pattern)):
            digest.update(f"{path.relative_to(root)}\0".encode())
            digest.update(hashlib.sha256(path.read_bytes()).digest())
    for name, *files in entries:
        digest.update(f"{name}\0".encode())
        for file in filter(None, files):
            digest.update(hashlib.sha256(Path(file).read_bytes()).digest())
    packages = sorted({"numpy", "scipy", *(f.package for f in FORMATS if f.package)})
    digest.update(f"{[_version(p) for p in packages]} {sys.version_info[:2]}".encode())
    compiler = find_compiler()
    digest.update(f"{compiler.name} {compiler.version()}".encode())
    return f"{__version__} {digest.hexdigest()[:16]}"


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return ""
