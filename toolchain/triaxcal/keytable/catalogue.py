"""Every kind of TOML file that a user writes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from triaxcal.base.keys import FileKeys
from triaxcal.design.problem import PROBLEM
from triaxcal.dynamic.description import imu_file
from triaxcal.rig.description.rigkeys import rig_file
from triaxcal.rig.plan.plan import session_plan_file
from triaxcal.simulation.imu_unit import IMU_TRUTH
from triaxcal.simulation.published import TABLES
from triaxcal.simulation.truth import TRUTH
from triaxcal.unit.description import recording_file, tilter_file

FILES: Mapping[str, Callable[[], FileKeys]] = MappingProxyType(
    {
        "tilter": tilter_file,
        "recording": recording_file,
        "imu": imu_file,
        "rig": session_plan_file,
        "rig-description": rig_file,
        "design": lambda: PROBLEM,
        "truth": lambda: TRUTH,
        "imu-truth": lambda: IMU_TRUTH,
        "tables": lambda: TABLES,
    }
)
"""Their keys by kind, made when they are asked for: registered entries are among them."""
