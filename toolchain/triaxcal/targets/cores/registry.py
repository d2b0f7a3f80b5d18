"""The cores that there are."""

from __future__ import annotations

from triaxcal.base.registry import Registry
from triaxcal.targets.cores.core import Core

CORES = Registry("core", "triaxcal.targets.cores", Core, ("gcc", "emulator"))
