"""The causes that compete."""

from __future__ import annotations

from triaxcal.base.registry import Registry
from triaxcal.diagnosis.core.cause import Cause, DwellCause

CAUSES: Registry[DwellCause] = Registry("cause", "triaxcal.diagnosis.causes", Cause, ("apart",))
