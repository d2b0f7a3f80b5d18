"""What a result was made by: this triaxcal to the last byte, its libraries and its compiler."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np

from triaxcal import __version__
from triaxcal.base.shipped import shipped
from triaxcal.codegen.compiler import find_compiler


@cache
def toolchain() -> str:
    """Version and 16 hex digits; equal where equal inputs give equal files.

    Raises
    ------
    RefusedError
        When there is no compiler.
    """
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
    digest.update(f"{np.__version__} {sys.version_info[:2]}".encode())
    version = subprocess.run([find_compiler(), "--version"], capture_output=True, check=False)
    digest.update(version.stdout)
    return f"{__version__} {digest.hexdigest()[:16]}"
