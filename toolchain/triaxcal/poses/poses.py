"""Poses of a recording: stretches at rest, long and steady enough; the reason of every refusal."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.types import FloatArray
from triaxcal.poses.directions import pose_angles
from triaxcal.poses.means import mean_of
from triaxcal.poses.refusals import no_poses
from triaxcal.poses.stated import refuse_wrong_unit
from triaxcal.poses.steady import Steady, reading_of_1_g
from triaxcal.poses.steps import Steps
from triaxcal.poses.stillness import SHORTEST_S, Stillness, duration_s, find_stillness
from triaxcal.readings.samples import ANGLES, READING, TEMP, Samples
from triaxcal.readings.table import ROW, TIME
from triaxcal.unit.recording import POSES, SECTIONS, RecordingLayout

_SAME_RAD = 1e-6
"""Angles of one pose are written alike in all its rows."""
SD_FLOOR_G = 1e-4
"""Standard deviation of a pose that no length of it removes."""
ALIKE_DEG = 5.0
"""Poses nearer than this to each other are one orientation."""


@dataclass(frozen=True)
class Pose:
    """Mean readings of one pose.

    Attributes
    ----------
    number : int
        Among all stretches at rest that were examined, from 1.
    line : int
        Line of its first sample.
    start_s, duration_s : float
    reading : array, shape (3,)
        In the unit of the layout.
    sd_mean : array, shape (3,), or None
        Standard deviation of `reading`: noise, sway and drift, and the steps of the readings; None
        where rows are poses.
    count : int
        Samples.
    temp_degc : float or None
    label : str
        Of its section; "" without.
    angles_rad : array, shape (2 or 3,), or None
    covariance : array, shape (3, 3), or None
        Of `reading`; `sd_mean` is the root of its diagonal.
    scatter : array, shape (3,), or None
        Standard deviation of the samples.
    drift : array, shape (3,), or None
        Mean of the second half less that of the first.
    file : str
        Of several files, the one in which `line` is; "" of one.
    """

    number: int
    line: int
    start_s: float
    duration_s: float
    reading: FloatArray
    sd_mean: FloatArray | None
    count: int
    temp_degc: float | None
    label: str
    angles_rad: FloatArray | None
    covariance: FloatArray | None = None
    scatter: FloatArray | None = None
    drift: FloatArray | None = None
    file: str = ""


@dataclass(frozen=True)
class RefusedPose:
    """A still stretch that is no pose, and why."""

    number: int
    line: int
    start_s: float
    duration_s: float
    reason: str


@dataclass(frozen=True)
class PoseSet:
    """Poses of one recording.

    Attributes
    ----------
    source : str
    poses : tuple of Pose
    refused : tuple of RefusedPose
    stillness : Stillness or None
        None where rows are poses, or sections say where they are.
    findings : tuple of str
    reading_of_1_g : float
        About; in the unit of the layout.
    """

    source: str
    poses: tuple[Pose, ...]
    refused: tuple[RefusedPose, ...]
    stillness: Stillness | None
    findings: tuple[str, ...]
    reading_of_1_g: float = 1.0

    @property
    def readings(self) -> FloatArray:
        """Shape (poses, 3)."""
        return np.array([p.reading for p in self.poses]).reshape(-1, 3)

    @property
    def temps_degc(self) -> FloatArray | None:
        """Shape (poses,); None when the recording has no temperature."""
        temps = [p.temp_degc for p in self.poses if p.temp_degc is not None]
        return np.array(temps) if len(temps) == len(self.poses) and temps else None

    @property
    def length_sd(self) -> FloatArray | None:
        """Standard deviation along the reading of each pose, (poses,); None where rows are poses.

        Along the reading less the middle of all: their zero may lie anywhere.
        """
        found = [p.covariance for p in self.poses if p.covariance is not None]
        if len(found) != len(self.poses):
            return None
        readings = self.readings
        spread = readings - (readings.max(axis=0) + readings.min(axis=0)) / 2.0
        lengths = np.linalg.norm(spread, axis=1)
        along = spread if lengths.min() > 0.1 * self.reading_of_1_g else readings
        along = along / np.linalg.norm(along, axis=1, keepdims=True)
        result: FloatArray = np.sqrt(np.einsum("pi,pij,pj->p", along, np.array(found), along))
        return result

    @property
    def weights(self) -> FloatArray | None:
        """Weight of each pose by its own uncertainty, 1 for the best; None where rows are poses."""
        sd = self.length_sd
        if sd is None:
            return None
        floor = SD_FLOOR_G * self.reading_of_1_g
        variance = sd**2 + floor**2
        result: FloatArray = variance.min() / variance
        return result


def find_poses(samples: Samples, layout: RecordingLayout, *, any_unit: bool = False) -> PoseSet:
    """Poses of samples: one a row, one a section or labelled face, or found by stillness.

    `any_unit` takes readings in another unit than stated as they are.

    Raises
    ------
    RefusedError
        When there is none (names the longest still stretch and what to change), and for readings
        in another unit than stated.
    """
    steps = Steps.of(samples)
    found = _found(samples, layout, steps)
    if not any_unit:
        refuse_wrong_unit(found.source, found.readings, layout, steps)
    return found


def _found(samples: Samples, layout: RecordingLayout, steps: Steps) -> PoseSet:
    if layout.rows == POSES:
        poses = _row_poses(samples, layout)
        one_g = reading_of_1_g(samples, layout)
        return PoseSet(samples.source, poses, (), None, samples.findings, one_g)
    if layout.rows == SECTIONS or layout.faces:
        return _section_poses(samples, layout, steps)
    one_g = reading_of_1_g(samples, layout)
    shortest_s = min(layout.still_s, SHORTEST_S)
    stillness = find_stillness(samples, shortest_s, one_g, steps.motion)
    candidates = [_pose(samples, run, n, one_g) for n, run in enumerate(stillness.runs, start=1)]
    coarse = steps.coarse(np.array([_scatter(p) for p in candidates]).reshape(-1, 3))
    steady = Steady(samples, layout, one_g, coarse)
    poses, refused = _sorted_out(
        (pose, steady.reason(run, _scatter(pose)))
        for pose, run in zip(candidates, stillness.runs, strict=True)
    )
    if not poses:
        raise no_poses(
            samples, layout, stillness, [(r.duration_s, r.reason) for r in refused], one_g
        )
    return _with_steps(
        PoseSet(samples.source, poses, refused, stillness, samples.findings, one_g), steps, layout
    )


def _sorted_out(
    judged: Iterable[tuple[Pose, str]],
) -> tuple[tuple[Pose, ...], tuple[RefusedPose, ...]]:
    """Poses, and the stretches at rest that are refused, with the reason."""
    poses: list[Pose] = []
    refused: list[RefusedPose] = []
    for pose, reason in judged:
        if reason:
            refused.append(
                RefusedPose(pose.number, pose.line, pose.start_s, pose.duration_s, reason)
            )
        else:
            poses.append(pose)
    return tuple(poses), tuple(refused)


def _row_poses(samples: Samples, layout: RecordingLayout) -> tuple[Pose, ...]:
    rows, times, readings = (samples.part(name) for name in (ROW, TIME, READING))
    temps = samples.part(TEMP) if TEMP in samples else None
    angles = pose_angles(samples, layout, 0, len(samples)) if ANGLES in samples else None
    return tuple(
        Pose(
            number=k + 1,
            line=int(rows[k]),
            start_s=float(times[k]),
            duration_s=0.0,
            reading=readings[k],
            sd_mean=None,
            count=1,
            temp_degc=None if temps is None else float(temps[k]),
            label=samples.label(k),
            angles_rad=None if angles is None else angles[k],
            file=Path(samples.file(k)).name,
        )
        for k in range(len(samples))
    )


def _sections(samples: Samples, layout: RecordingLayout) -> Iterator[tuple[Pose, str]]:
    """Each stretch of rows with one label, and why it is no pose.

    Without a label it is what lies between poses; with `faces` only their labels count.
    """
    one_g = reading_of_1_g(samples, layout)
    steady = Steady(samples, layout, one_g, np.zeros(3, dtype=np.bool_))
    number = 0
    for run in samples.runs():
        label = samples.label(run[0])
        if not label.strip() or (layout.faces and label not in layout.faces):
            continue
        number += 1
        pose = _pose(samples, run, number, one_g)
        reason = steady.moves(_scatter(pose))
        if ANGLES in samples:
            angles = pose_angles(samples, layout, *run)
            pose = replace(pose, angles_rad=angles[0])
            if np.ptp(angles, axis=0).max() > _SAME_RAD:
                reason = "its angles change within the section"
        yield pose, reason


def _section_poses(samples: Samples, layout: RecordingLayout, steps: Steps) -> PoseSet:
    poses, refused = _sorted_out(_sections(samples, layout))
    if not poses:
        first = f": pose {refused[0].number}: {refused[0].reason}" if refused else ""
        labels = ""
        if layout.faces and not refused:
            labels = f"; sections found: {', '.join(sorted(samples.table.labels or ())[:10])}"
        raise RefusedError(
            samples.source,
            f"no section is a pose{first}{labels}",
            expected="sections held still" + ", labelled as in [recording] faces" * bool(labels),
        )
    one_g = reading_of_1_g(samples, layout)
    found = PoseSet(samples.source, poses, refused, None, samples.findings, one_g)
    return _with_steps(found, steps, layout)


def _with_steps(found: PoseSet, steps: Steps, layout: RecordingLayout) -> PoseSet:
    """Poses whose uncertainty has the steps of the readings; a finding where these limit it."""
    left = steps.sd_of_mean(np.array([_scatter(p) for p in found.poses]))
    poses = tuple(
        replace(p, covariance=p.covariance + np.diag(sd**2), sd_mean=np.hypot(p.sd_mean, sd))
        for p, sd in zip(found.poses, left, strict=True)
        if p.covariance is not None and p.sd_mean is not None
    )
    told = steps.finding(left, np.array([p.sd_mean for p in poses]), layout, found.reading_of_1_g)
    return replace(found, poses=poses, findings=(*found.findings, *told))


def _scatter(pose: Pose) -> FloatArray:
    return np.zeros(3) if pose.scatter is None else pose.scatter


def _pose(samples: Samples, run: tuple[int, int], number: int, one_g: float) -> Pose:
    start, stop = run
    mean = mean_of(samples, run, one_g)
    return Pose(
        number=number,
        line=int(samples.one(ROW, start)),
        start_s=samples.one(TIME, start),
        duration_s=duration_s(samples, run),
        reading=mean.reading,
        sd_mean=np.sqrt(np.diag(mean.covariance)),
        count=stop - start,
        temp_degc=float(samples.mean(TEMP, start, stop)) if TEMP in samples else None,
        label=samples.label(start),
        angles_rad=None,
        covariance=mean.covariance,
        scatter=mean.scatter,
        drift=mean.drift,
        file=Path(samples.file(start)).name,
    )


def orientation_groups(directions: FloatArray, angle_deg: float = ALIKE_DEG) -> list[list[int]]:
    """Indices of poses that point alike: those within `angle_deg` of a first one, and so on.

    Not chained: a hundred poses all round must not become one orientation.
    """
    cosine, left = np.cos(np.radians(angle_deg)), np.arange(len(directions))
    groups: list[list[int]] = []
    while len(left):
        near = directions[left] @ directions[left[0]] >= cosine
        near[0] = True
        groups.append(left[near].tolist())
        left = left[~near]
    return groups
