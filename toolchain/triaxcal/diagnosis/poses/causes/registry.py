"""The causes that compete for the poses of a recording."""

from __future__ import annotations

from triaxcal.base.registry import Registry
from triaxcal.diagnosis.core.cause import Cause
from triaxcal.diagnosis.poses.core.cause import PoseCause

POSE_CAUSES: Registry[PoseCause] = Registry(
    "cause", "triaxcal.diagnosis.poses.causes", Cause, ("apart",)
)
