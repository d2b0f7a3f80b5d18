"""Turns on a table: about one axis of the unit, and without accelerations of their own.

On a table the unit turns about an axis that stays where it is in the unit, and the accelerometers
feel gravity, what their biases and scale factors add, and the accelerations of a place beside the
axis. A hand turns about an axis that wanders, and moves the unit while it turns it. A turn whose
accelerations contradict a table is integrated by the gyros alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from triaxcal.dynamic.recording import HAND, TABLE, ImuRecording
from triaxcal.dynamic.rests import Quiet
from triaxcal.dynamic.windows import Windows
from triaxcal.model.types import BoolArray, FloatArray, IntArray

AXIS_COSINE = np.cos(np.radians(25.0))
"""A turn counts as one about an instrument axis within 25 deg."""
STAGE_TURN_RAD = np.pi
"""Less than half a turn about an axis is handling, not a stage."""
ESTABLISHED_RAD = 4 * np.pi
"""A hand turns about one axis once at most; what turns further may be a table."""
STEADY_AXIS = np.tan(np.radians(1.0))
"""A bearing leans by arcminutes, a hand by degrees: rate across the mean axis over the rate."""
RESIDUAL_SD = 3.0
"""A motor may shake the forces by so many times the noise at rest."""
RESIDUAL_M_PER_S2 = 0.003
"""What the thermal drift of a run and the bend of a window's arc leave in the size of the force."""
PLACE_M = 0.2
BIAS_M_PER_S2 = 0.1
SCALE = 0.02
"""Standard deviations, before the test, of where an accelerometer is from the axis, of its bias and
of its scale factor: a coarse unit, not yet calibrated."""
COLUMNS = 18


@dataclass(frozen=True)
class Stage:
    """One axis on the table.

    Attributes
    ----------
    axis : int
        Instrument axis 0, 1, 2 that the unit turned about.
    start_s, end_s : float
        From the stand-still before its first turn to the end of its last.
    turned_rad : float
        Sum of the turns, both senses.
    """

    axis: int
    start_s: float
    end_s: float
    turned_rad: float


@dataclass(frozen=True)
class _Run:
    """Windows that turn about one axis, stand-stills disregarded; kind is the axis, or -2."""

    kind: int
    windows: IntArray
    start_s: float
    end_s: float
    turned_rad: float


def find_stages(
    windows: Windows, quiet: Quiet, recording: ImuRecording
) -> tuple[tuple[Stage, ...], BoolArray]:
    """Stages, and the windows of each from its first turn to its last, stops included.

    By the recording's `motion` all turns about an axis are the table's, or none; with "" each is
    judged. Where another recording starts, the unit was put on the table anew.
    """
    turning = np.zeros(len(windows.first), dtype=bool)
    if recording.motion == HAND:
        return (), turning
    runs = _runs(windows, quiet)
    candidates = [r for r in runs if r.kind >= 0 and r.turned_rad >= STAGE_TURN_RAD]
    if recording.motion != TABLE:
        candidates = _on_table(windows, quiet, candidates, recording.gravity_m_per_s2)
    stages: list[Stage] = []
    for run in candidates:
        turning[run.windows[0] : run.windows[-1] + 1] = True
        last = stages[-1] if stages else None
        begin_s = float(windows.start_s[run.windows[0]])
        anew = last and any(last.start_s < s <= begin_s for s in recording.starts_s)
        if last is not None and last.axis == run.kind and not anew:
            stages[-1] = replace(last, end_s=run.end_s, turned_rad=last.turned_rad + run.turned_rad)
        else:
            stages.append(Stage(run.kind, run.start_s, run.end_s, run.turned_rad))
    return tuple(stages), turning


def _runs(windows: Windows, quiet: Quiet) -> list[_Run]:
    rate = windows.rate - quiet.bias
    speed = np.linalg.norm(rate, axis=1)
    axis = np.argmax(np.abs(rate), axis=1)
    along = np.abs(rate[np.arange(len(rate)), axis]) >= AXIS_COSINE * speed
    label = np.where(quiet.still, -1, np.where(along, axis, -2))
    turning = np.flatnonzero(label != -1)
    if len(turning) == 0:
        return []
    key = label[turning] + 4 * windows.section[turning]
    breaks = np.flatnonzero(np.diff(key)) + 1
    runs, end_before = [], float(windows.start_s[0])
    for run in np.split(turning, breaks):
        turned = float((speed[run] * windows.duration_s[run]).sum())
        end = float(windows.start_s[run[-1]] + windows.duration_s[run[-1]])
        runs.append(_Run(int(label[run[0]]), run, end_before, end, turned))
        end_before = end
    return runs


def _on_table(windows: Windows, quiet: Quiet, candidates: list[_Run], gravity: float) -> list[_Run]:
    """Candidates that can be turns on a table; all runs of an axis in a row are judged together."""
    groups: list[list[_Run]] = []
    for run in candidates:
        if groups and groups[-1][-1].kind == run.kind:
            groups[-1].append(run)
        else:
            groups.append([run])
    return [
        run
        for group in groups
        if sum(run.turned_rad for run in group) >= ESTABLISHED_RAD
        and _steady_axis(windows, quiet, group)
        and _rigid(windows, quiet, group, gravity)
        for run in group
    ]


def _steady_axis(windows: Windows, quiet: Quiet, group: list[_Run]) -> bool:
    """Whether the rate keeps its direction in the unit, in each run."""
    for run in group:
        rate = (windows.rate - quiet.bias)[run.windows]
        mean = (rate * np.sign(rate[:, [run.kind]])).sum(axis=0)
        mean /= np.linalg.norm(mean)
        across = rate - np.outer(rate @ mean, mean)
        limit = STEADY_AXIS * np.sqrt((rate**2).sum(axis=1).mean()) + quiet.limit
        if np.sqrt((across**2).sum(axis=1).mean()) > limit:
            return False
    return True


def _rigid(windows: Windows, quiet: Quiet, group: list[_Run], gravity: float) -> bool:
    """Whether the size of the force is what a rigid table explains.

    |f| - g is, to first order in small errors, u . (b + S f) + sum of u_i (K r_i)_i with u = f/|f|,
    K = [w'] + [w]^2, and r_i the place of accelerometer i: 18 unknowns that the run itself finds,
    within what a coarse unit may have. Runs too short to overdetermine them do not count.
    """
    rows, values = [], []
    for run in group:
        inside = np.arange(run.windows[0], run.windows[-1] + 1)
        rate = (windows.rate - quiet.bias)[inside]
        force = _at_the_middle(windows.force[inside], rate, windows.duration_s[inside])
        size = np.linalg.norm(force, axis=1)
        up = force / size[:, None]
        change = np.zeros_like(rate)
        if len(inside) > 1:
            change = np.gradient(rate, windows.start_s[inside], axis=0)
        moving = np.isin(inside, run.windows)
        rows.append(_columns(up, rate, change)[moving])
        values.append((size - gravity)[moving])
    A, y = np.concatenate(rows), np.concatenate(values)
    if len(y) < 3 * COLUMNS:
        return False
    limit = RESIDUAL_SD * quiet.noise.force + RESIDUAL_M_PER_S2
    prior = limit / np.repeat([BIAS_M_PER_S2, SCALE * gravity, PLACE_M], [3, 6, 9])
    whole = np.concatenate([A, np.diag(prior)])
    found = np.linalg.lstsq(whole, np.concatenate([y, np.zeros(COLUMNS)]), rcond=None)[0]
    rest = y - A @ found
    return bool(np.sqrt(rest @ rest / (len(y) - COLUMNS)) < limit)


def _at_the_middle(force: FloatArray, rate: FloatArray, duration_s: FloatArray) -> FloatArray:
    """Force at the middle of a window of its mean: a mean over an arc is shorter across the rate.

    To the fourth order the part across shrinks by sin(x)/x, x half of the turn.
    """
    speed = np.linalg.norm(rate, axis=1)
    axis = rate / np.maximum(speed, 1e-12)[:, None]
    along = np.einsum("ni,ni->n", force, axis)[:, None] * axis
    shrunk = np.sinc(speed * duration_s / (2 * np.pi))[:, None]
    middle: FloatArray = along + (force - along) / np.maximum(shrunk, 0.1)
    return middle


def _columns(up: FloatArray, rate: FloatArray, change: FloatArray) -> FloatArray:
    """Derivatives (n, 18) of |f|: three biases, six of a symmetric matrix, nine of three places."""
    i, j = np.triu_indices(3)
    square = np.einsum("ni,nj->nij", rate, rate)
    square -= np.eye(3) * (rate**2).sum(axis=1)[:, None, None]
    turned = np.zeros_like(square)
    for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        turned[:, b, a], turned[:, a, b] = change[:, c], -change[:, c]
    places = (up[:, :, None] * (turned + square)).reshape(-1, 9)
    return np.concatenate([up, up[:, i] * up[:, j], places], axis=1)
