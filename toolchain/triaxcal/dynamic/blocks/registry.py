"""The extensions of the base model that there are."""

from __future__ import annotations

from triaxcal.base.registry import Registry
from triaxcal.dynamic.blocks.block import Extension

EXTENSIONS = Registry("state block", "triaxcal.dynamic.blocks", Extension, ("blocks",))
