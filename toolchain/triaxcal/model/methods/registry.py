"""The compensation methods that there are."""

from __future__ import annotations

from triaxcal.base.registry import Registry
from triaxcal.model.methods.method import CompensationMethod

METHODS = Registry(
    "compensation method",
    "triaxcal.model.methods",
    CompensationMethod,
    ("short_label", "colour", "form"),
)
