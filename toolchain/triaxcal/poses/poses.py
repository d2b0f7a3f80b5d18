"""Poses of a recording: stretches at rest, long and steady enough; the reason of every refusal."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.types import FloatArray
from triaxcal.poses.directions import pose_angles
from triaxcal.poses.means import mean_of
from triaxcal.poses.poseset import Pose, PoseSet, RefusedPose
from triaxcal.poses.refusals import no_poses
from triaxcal.poses.stated import refuse_wrong_unit
from triaxcal.poses.steady import Steady, reading_of_1_g
from triaxcal.poses.steps import Steps
from triaxcal.poses.stillness import SHORTEST_S, duration_s, find_stillness
from triaxcal.readings.samples import ANGLES, READING, TEMP, Samples
from triaxcal.readings.table import ROW, TIME
from triaxcal.unit.recording import POSES, SECTIONS, RecordingLayout

__all__ = ["ALIKE_DEG", "Pose", "PoseSet", "RefusedPose", "find_poses", "orientation_groups"]

_SAME_RAD = 1e-6
"""Angles of one pose are written alike in all its rows."""
ALIKE_DEG = 5.0
"""Poses nearer than this to each other are one orientation."""


def find_poses(
    samples: Samples,
    layout: RecordingLayout,
    *,
    any_unit: bool = False,
    factors: Iterable[float] = (),
) -> PoseSet:
    """Poses of samples: one a row, one a section or labelled face, or found by stillness.

    `any_unit` takes readings in another unit than stated as they are; `factors` are those of other
    units and scales that are taken so.

    Raises
    ------
    RefusedError
        When there is none (names the longest still stretch and what to change), and for readings
        in another unit than stated.
    """
    steps = Steps.of(samples)
    found = _found(samples, layout, steps)
    if not any_unit:
        refuse_wrong_unit(found.source, found.readings, layout, steps, factors)
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
    judged: Iterable[tuple[Pose, tuple[str, str]]],
) -> tuple[tuple[Pose, ...], tuple[RefusedPose, ...]]:
    """Poses, and the stretches at rest that are refused, with the reason and a clipped end."""
    poses: list[Pose] = []
    refused: list[RefusedPose] = []
    for pose, (reason, end) in judged:
        if reason:
            refused.append(
                RefusedPose(pose.number, pose.line, pose.start_s, pose.duration_s, reason, end)
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
    poses, refused = _sorted_out((pose, (why, "")) for pose, why in _sections(samples, layout))
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
    words = steps.finding(left, np.array([p.sd_mean for p in poses]), layout, found.reading_of_1_g)
    return replace(found, poses=poses, findings=(*found.findings, *words))


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
