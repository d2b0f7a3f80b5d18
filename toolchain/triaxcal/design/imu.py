"""What a planned motion will let a unit see: the filter's covariance, without a recording.

The covariance depends on the motion and the noise, and on measured values only by what the filter
linearises about. So the plan is simulated with a perfect unit without noise, and the filter gets
the noise of the data sheet.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.base.progress import Progress
from triaxcal.dynamic.calibrate import calibrate_dynamic
from triaxcal.dynamic.description import DynamicDescription, read_dynamic
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.observability import observability
from triaxcal.dynamic.unit import DynamicUnit
from triaxcal.simulation.imu import simulate_imu
from triaxcal.simulation.imu_truth import ImuTruth, SecondTriad
from triaxcal.simulation.imu_unit import planned_motion


def plan_unit(folder: Path, progress: Progress) -> DynamicUnit:
    """Standard deviations that the unit in `folder` will have after the motion it plans.

    The motion is that of [motion] in imu_truth.toml, everything else of unit.toml; the recording
    that unit.toml names is not read. The values of the result's states are zero.

    Raises
    ------
    RefusedError
        As `planned_motion`, `read_dynamic` and `calibrate_dynamic`; where [noise] states no white
        noise.
    """
    unit = read_dynamic(folder)
    motion, rate_hz = planned_motion(folder)
    truth = ImuTruth(
        second=SecondTriad() if "second-triad" in unit.blocks else None,
        rate_convention=unit.rate_convention,
        force_convention=unit.force_convention,
    )
    result = calibrate_dynamic(
        simulate_imu(truth, motion, rate_hz, 0),
        _planned_noise(unit),
        unit.state_blocks(),
        reference_degc=unit.reference_degc,
        progress=lambda number, part: progress(f"pass {number + 1}", part),
    )
    return DynamicUnit(unit, result, observability(result.layout, result.covariance), (), ())


def _planned_noise(unit: DynamicDescription) -> DataSheet:
    """Noise of a recording that there is not yet; a bias instability that is not stated is 0."""
    noise = unit.noise
    for name in ("gyro_arw_deg_per_sqrt_h", "accel_vrw_ug_per_sqrt_hz"):
        if getattr(noise, name) is None:
            raise RefusedError(
                f"{unit.path}, [noise] {name}",
                "not stated",
                expected="the figure of the data sheet: a plan has no recording to take it from",
                remedy=f"add {name} to [noise]",
            )
    return replace(
        noise,
        gyro_bias_instability_deg_per_h=noise.gyro_bias_instability_deg_per_h or 0.0,
        accel_bias_instability_ug=noise.accel_bias_instability_ug or 0.0,
    )
