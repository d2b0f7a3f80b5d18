"""The targets that there are."""

from __future__ import annotations

from triaxcal.base.registry import Registry
from triaxcal.exports.target import Target

TARGETS = Registry("export target", "triaxcal.exports.targets", Target)
