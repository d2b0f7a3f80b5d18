"""Poses of a recording: stretches at rest, long and steady enough; the reason of every refusal."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.types import FloatArray
from triaxcal.poses.steady import Steady
from triaxcal.poses.stillness import Stillness, duration_s, find_stillness
from triaxcal.readings.samples import ANGLES, READING, TEMP, Samples
from triaxcal.readings.table import ROW, TIME
from triaxcal.unit.recording import POSES, SECTIONS, RecordingLayout
from triaxcal.unit.recordingfile import TIME_UNITS

BATCHES = 8
_STEPS_S = (5e-4, 0.5)
"""Plausible times between samples: they distinguish seconds from milliseconds."""
_SAME_RAD = 1e-6
"""Angles of one pose are written alike in all its rows."""
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
        Standard error of `reading`, from batch means; None where rows are poses.
    count : int
        Samples.
    temp_degc : float or None
    label : str
        Of its section; "" without.
    angles_rad : array, shape (2 or 3,), or None
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
    """

    source: str
    poses: tuple[Pose, ...]
    refused: tuple[RefusedPose, ...]
    stillness: Stillness | None
    findings: tuple[str, ...]

    @property
    def readings(self) -> FloatArray:
        """Shape (poses, 3)."""
        return np.array([p.reading for p in self.poses]).reshape(-1, 3)

    @property
    def temps_degc(self) -> FloatArray | None:
        """Shape (poses,); None when the recording has no temperature."""
        temps = [p.temp_degc for p in self.poses if p.temp_degc is not None]
        return np.array(temps) if len(temps) == len(self.poses) and temps else None


def find_poses(samples: Samples, layout: RecordingLayout) -> PoseSet:
    """Poses of samples: one a row, one a section or labelled face, or found by stillness.

    Raises
    ------
    RefusedError
        When there is none; names the longest still stretch and what to change.
    """
    if layout.rows == POSES:
        return PoseSet(samples.source, _row_poses(samples), (), None, samples.findings)
    if layout.rows == SECTIONS or layout.faces:
        return _section_poses(samples, layout)
    stillness = find_stillness(samples, layout.still_s)
    steady = Steady(samples, layout)
    poses, refused = _sorted_out(
        (_pose(samples, run, number), steady.reason(run))
        for number, run in enumerate(stillness.runs, start=1)
    )
    if not poses:
        raise _no_poses(samples, layout, refused)
    return PoseSet(samples.source, poses, refused, stillness, samples.findings)


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


def _row_poses(samples: Samples) -> tuple[Pose, ...]:
    rows, times, readings = (samples.part(name) for name in (ROW, TIME, READING))
    temps = samples.part(TEMP) if TEMP in samples else None
    angles = samples.part(ANGLES) if ANGLES in samples else None
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
        )
        for k in range(len(samples))
    )


def _sections(samples: Samples, layout: RecordingLayout) -> Iterator[tuple[Pose, str]]:
    """Each stretch of rows with one label, and why it is no pose.

    Without a label it is what lies between poses; with `faces` only their labels count.
    """
    steady = Steady(samples, layout)
    number = 0
    for run in samples.runs():
        label = samples.label(run[0])
        if not label.strip() or (layout.faces and label not in layout.faces):
            continue
        number += 1
        pose = _pose(samples, run, number)
        reason = steady.moves(samples.deviation(READING, *run))
        if ANGLES in samples:
            angles = samples.part(ANGLES, *run)
            pose = replace(pose, angles_rad=angles[0])
            if np.ptp(angles, axis=0).max() > _SAME_RAD:
                reason = "its angles change within the section"
        yield pose, reason


def _section_poses(samples: Samples, layout: RecordingLayout) -> PoseSet:
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
    return PoseSet(samples.source, poses, refused, None, samples.findings)


def _pose(samples: Samples, run: tuple[int, int], number: int) -> Pose:
    start, stop = run
    batches = min(BATCHES, stop - start)
    each, more = divmod(stop - start, batches)
    ends = [start + k * each + min(k, more) for k in range(batches + 1)]
    means = np.array([samples.mean(READING, *part) for part in pairwise(ends)])
    sd_mean = means.std(axis=0, ddof=1) / np.sqrt(batches) if batches > 1 else np.full(3, np.inf)
    return Pose(
        number=number,
        line=int(samples.one(ROW, start)),
        start_s=samples.one(TIME, start),
        duration_s=duration_s(samples, run),
        reading=samples.mean(READING, start, stop),
        sd_mean=sd_mean,
        count=stop - start,
        temp_degc=float(samples.mean(TEMP, start, stop)) if TEMP in samples else None,
        label=samples.label(start),
        angles_rad=None,
    )


def _no_poses(
    samples: Samples, layout: RecordingLayout, refused: Sequence[RefusedPose]
) -> RefusedError:
    longest = max((r.duration_s for r in refused), default=0.0)
    first = f"; pose {refused[0].number}: {refused[0].reason}" if refused else ""
    return RefusedError(
        samples.source,
        f"no pose found: the longest stretch at rest lasts {longest:.3g} s{first}",
        expected=f"poses of at least {layout.still_s:g} s",
        remedy=_wrong_clock(samples, layout)
        or "hold each pose longer, or lower [recording] still_s; "
        "`triaxcal poses` shows what was found",
    )


def _wrong_clock(samples: Samples, layout: RecordingLayout) -> str:
    """Remedy for a recording that is too short for a few poses; "" otherwise."""
    whole = samples.one(TIME, len(samples) - 1) + samples.step_s
    if whole > 4.0 * layout.still_s:
        return ""
    lasts = f"the whole recording lasts {whole:.3g} s"
    if layout.sample_rate_hz is not None:
        return f"{lasts} at {1.0 / samples.step_s:g} Hz: check sample_rate_hz"
    if not layout.time:
        return lasts
    scale = TIME_UNITS[layout.time_unit[0]]
    near = [
        u for u, s in TIME_UNITS.items() if _STEPS_S[0] < samples.step_s / scale * s < _STEPS_S[1]
    ]
    return f"{lasts}: check time_unit" + (f', as time_unit = "{near[0]}"' if near else "")


def orientation_groups(directions: FloatArray, angle_deg: float = ALIKE_DEG) -> list[list[int]]:
    """Indices of poses that point alike: those within `angle_deg` of a first one, and so on.

    Not chained: a hundred poses all round must not become one orientation.
    """
    near = directions @ directions.T >= np.cos(np.radians(angle_deg))
    left = np.ones(len(directions), dtype=np.bool_)
    groups: list[list[int]] = []
    for first in range(len(directions)):
        if left[first]:
            group = np.flatnonzero(near[first] & left)
            left[group] = False
            groups.append(group.tolist())
    return groups
