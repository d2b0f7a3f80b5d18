"""Every extension that there is: each file of blocks/ that defines EXTENSION."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from triaxcal.dynamic import blocks
from triaxcal.dynamic.block import Extension


@cache
def extensions() -> dict[str, Extension]:
    """Extensions by name, in the order of the names."""
    found = {}
    for module in pkgutil.iter_modules(blocks.__path__, blocks.__name__ + "."):
        extension = getattr(importlib.import_module(module.name), "EXTENSION", None)
        if isinstance(extension, Extension):
            found[extension.name] = extension
    return dict(sorted(found.items()))
