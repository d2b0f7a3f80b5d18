"""What the other commands do: poses, drift, history, design, simulation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from triaxcal.api.study import Study
from triaxcal.api.unit import Unit
from triaxcal.base.errors import RefusedError
from triaxcal.base.progress import Progress
from triaxcal.design.imu import plan_unit
from triaxcal.design.imudemands import plan_demands
from triaxcal.design.problem import Problem, read_problem
from triaxcal.design.search import Design, best, usual
from triaxcal.design.words import comparison, rig_plan
from triaxcal.dynamic.unit import DynamicUnit
from triaxcal.fitting.core.drift import Drift, study
from triaxcal.poses.poses import find_poses as poses_of
from triaxcal.poses.poseset import PoseSet
from triaxcal.readings.samples import Samples, read_samples
from triaxcal.report import studies
from triaxcal.report.history import history_text, read_history
from triaxcal.report.imuplan import plan_summary
from triaxcal.simulation.series import write_series
from triaxcal.simulation.unit import write_simulated_unit
from triaxcal.uncertainty.history import Change, changes, repeatability
from triaxcal.unit.recording import RecordingLayout


def find_poses(unit: Unit) -> Study[PoseSet]:
    """Poses in the recording of a unit, and the stretches at rest that are refused and why.

    Raises
    ------
    RefusedError
        When the unit has no [recording], it cannot be read, or it is never at rest.
    """
    layout, samples = _recorded(unit)
    found = poses_of(samples, layout)
    return Study(
        found,
        studies.poses_text(found, layout),
        lambda: studies.poses_picture(samples, found, layout),
    )


def study_drift(unit: Unit) -> Study[Drift]:
    """Heating against cooling in one orientation: hysteresis, and a term in dT/dt.

    Raises
    ------
    RefusedError
        When the unit has no [recording], or its readings are no thermal cycle.
    """
    layout, samples = _recorded(unit)
    found = study(samples)
    return Study(
        found,
        studies.drift_text(found, layout),
        lambda: studies.drift_picture(samples, found, layout),
    )


def compare_history(unit: Unit, build: str | Path = "build") -> Study[list[Change]]:
    """Changes between the calibrations of a unit: those in history/, then that of its readings.

    Updates by poses from the field that were delivered below `build` count as well: those of the
    present calibration come last.

    Raises
    ------
    RefusedError
        When the unit has no folder, or one of them cannot be calibrated.
    """
    delivered = Path(build) / unit.name / "calibration.json"
    found = read_history(_folder(unit), unit.description, delivered)
    change = changes(unit.description, found)
    repeat = repeatability(unit.description, found)
    return Study(change, history_text(unit.serial, found, change, repeat))


@dataclass(frozen=True)
class MeasurementPlan:
    """A plan of least chamber time.

    Attributes
    ----------
    problem : Problem
        The question.
    usual, best : Design
        The usual plan, and the one that takes least time.
    """

    problem: Problem
    usual: Design
    best: Design

    def session_plan(self, made_by: str) -> str:
        """TOML of the best plan, for `triaxcal rig run --plan`; `made_by` is in a comment."""
        return rig_plan(self.problem, self.best, made_by)


def plan_measurements(question: str | Path) -> Study[MeasurementPlan]:
    """What to measure, and for how long, for a wanted uncertainty.

    Raises
    ------
    RefusedError
        When the file breaks a rule, or no candidate reaches the uncertainty.
    """
    problem = read_problem(Path(question))
    ordinary = usual(problem)
    found = best(problem, problem.target_g or ordinary.expanded_g)
    return Study(MeasurementPlan(problem, ordinary, found), comparison(problem, ordinary, found))


def simulate(folder: str | Path, seed: int | None = None) -> Path:
    """Write the readings of a simulated unit or IMU from the truth in its folder.

    Returns
    -------
    Path
        measurements.csv, or recording.csv of an IMU.

    Raises
    ------
    RefusedError
        When the folder has no truth, or it breaks a rule.
    """
    return write_simulated_unit(Path(folder), seed)


def simulate_series(
    folder: str | Path, into: str | Path, count: int, seed: int = 1
) -> Iterator[Path]:
    """Write `count` units that differ from the one in `folder`; yields the folder of each.

    Raises
    ------
    RefusedError
        As `simulate`; when `into` has units already.
    """
    return write_series(Path(folder), Path(into), count, seed)


def plan_motion(folder: str | Path, progress: Progress | None = None) -> Study[DynamicUnit]:
    """What a planned motion determines of an IMU, and which reaches [limits]; without a recording.

    The motion is that of imu_truth.toml, or where there is none the usual one on a table. With
    demands in [limits] of unit.toml the summary says how much of it, and of a motion by hand,
    reaches them, and what limits each.

    Raises
    ------
    RefusedError
        When a file breaks a rule.
    """
    report = progress or (lambda _step, _part: None)
    done = plan_unit(Path(folder), report)
    return Study(done, plan_summary(plan_demands(done, report)))


def _folder(unit: Unit) -> Path:
    if unit.folder is None:
        raise RefusedError(
            f"unit {unit.name}",
            "made without a folder",
            expected="a unit's folder",
            remedy="read it with read_unit(folder)",
        )
    return unit.folder


def _recorded(unit: Unit) -> tuple[RecordingLayout, Samples]:
    folder, layout = _folder(unit), unit.description.recording
    if layout is None:
        raise RefusedError(
            f"{folder}/unit.toml",
            "no table [recording]",
            expected="a unit whose readings are a recording",
            remedy="see docs/how-to/recordings.md",
        )
    return layout, read_samples(folder, layout, unit.description.temperature_sensor)
