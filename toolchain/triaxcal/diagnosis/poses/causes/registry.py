"""The causes that compete for the poses of a recording."""

from __future__ import annotations

from triaxcal.base.registry import Registry
from triaxcal.diagnosis.core.cause import Cause

POSE_CAUSES = Registry("cause", "triaxcal.diagnosis.poses.causes", Cause, ("apart",))
