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
from triaxcal.design.imuprogrammes import Programme, programmes_of
from triaxcal.dynamic.calibrate import calibrate_dynamic
from triaxcal.dynamic.description import DynamicDescription, read_dynamic
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.observability import observability
from triaxcal.dynamic.unit import DynamicUnit


def plan_unit(folder: Path, progress: Progress) -> DynamicUnit:
    """Standard deviations that the unit in `folder` will have after the motion it plans.

    The motion is that of [motion] in imu_truth.toml, or where there is no such file the usual one
    on a table; everything else is of unit.toml. The recording that unit.toml names is not read. The
    values of the result's states are zero.

    Raises
    ------
    RefusedError
        As `programmes_of`, `read_dynamic` and `planned`.
    """
    unit = read_dynamic(folder)
    programme = programmes_of(unit)[0]
    return planned(unit, programme, programme.size, progress)


def planned(
    unit: DynamicDescription, programme: Programme, size: float, progress: Progress
) -> DynamicUnit:
    """What a programme of a size determines; its recording is kept in the result.

    Raises
    ------
    RefusedError
        As `calibrate_dynamic`; where [noise] states no white noise.
    """
    recording = programme.recording(size)
    blocks = tuple(b for b in unit.state_blocks() if b.needs not in programme.without)
    result = calibrate_dynamic(
        recording,
        _planned_noise(unit),
        blocks,
        reference_degc=unit.reference_degc,
        progress=lambda number, part: progress(f"{programme.name}, pass {number + 1}", part),
    )
    seen = observability(result.layout, result.covariance)
    named = replace(recording, name=f"{programme.name}, {programme.said(size)}")
    return DynamicUnit(unit, result, seen, (), (), recording=named)


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
