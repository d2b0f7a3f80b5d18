"""What is wrong with poses whose angles are known, each fault with what to do; and their forces."""

from __future__ import annotations

import math

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.recorded.checks import CONDITION_MAX, turned_columns
from triaxcal.fitting.recorded.temperatures import temperature_groups
from triaxcal.fitting.table.oriented import design_condition, inverse_linear
from triaxcal.model.orientation import gravity_direction
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray, IntArray
from triaxcal.poses.poseset import PoseSet
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.recording import Angles, RecordingLayout

_ANSWERS = 0.05
"""Share of the liveliest output's sensitivity: less is noise, or what leaks from the others."""


def refuse_few_poses(poses: PoseSet) -> None:
    """Refuse poses that are too few to hold one out."""
    if len(poses.poses) < 6:
        raise RefusedError(
            poses.source,
            f"{len(poses.poses)} pose{'s' * (len(poses.poses) != 1)} with angles",
            expected="at least 6: four constants for each output, and two to check",
            remedy="measure more positions",
        )


def refuse_open(poses: PoseSet, direction: FloatArray) -> None:
    """Refuse angles that do not determine a constant."""
    condition = design_condition(direction)
    if condition > CONDITION_MAX:
        raise RefusedError(
            poses.source,
            f"the angles of the {len(poses.poses)} poses do not determine all constants (condition "
            f"number {condition:.3g})",
            expected=f"at most {CONDITION_MAX:g}",
            remedy="add poses over both angles",
        )


def refuse_silent(poses: PoseSet, force: FloatArray) -> None:
    """Refuse an output that does not follow the known force (n, 3), or that repeats another one."""
    design = np.concatenate([np.ones((len(force), 1)), force], axis=1)
    K = np.linalg.lstsq(design, poses.readings, rcond=None)[0][1:].T
    length = np.linalg.norm(K, axis=1)
    liveliest = int(length.argmax())
    expected = "three outputs, each following the force along an axis of its own"
    remedy = "check the wiring and the columns of [recording] acceleration"
    for i in np.flatnonzero(length <= _ANSWERS * length[liveliest]).tolist():
        raise RefusedError(
            poses.source,
            f"output {AXES[i]} does not respond to the force: its sensitivity is "
            f"{length[i] / (length[liveliest] or 1.0):.2g} of that of output {AXES[liveliest]}",
            expected=expected,
            remedy=remedy,
        )
    rows = K / length[:, None]
    if np.linalg.cond(rows) > CONDITION_MAX:
        cosine = np.abs(rows @ rows.T) - np.eye(3)
        first, second = divmod(int(np.argmax(np.triu(cosine, 1))), 3)
        raise RefusedError(
            poses.source,
            f"outputs {AXES[first]} and {AXES[second]} respond alike: their sensing axes are "
            f"{math.degrees(math.acos(min(1.0, cosine[first, second]))):.2g} deg apart",
            expected=expected,
            remedy=remedy,
        )


def pose_temperatures(unit: UnitDescription, poses: PoseSet) -> tuple[FloatArray, list[list[int]]]:
    """Temperatures of the poses, (n,), T0 where none was recorded; and the poses of each."""
    recorded = poses.temps_degc
    temps = np.full(len(poses.poses), unit.t0_degc) if recorded is None else recorded
    return temps, temperature_groups(temps)


def _linear_residual(readings: FloatArray, force: FloatArray) -> float:
    centred = readings - readings.mean(axis=0)
    design = np.concatenate([np.ones((len(centred), 1)), centred], axis=1)
    left = force - design @ np.linalg.lstsq(design, force, rcond=None)[0]
    return float(np.sqrt(np.mean(left**2)))


def refuse_degrees(
    source: str,
    angles: Angles,
    readings: FloatArray,
    table: FloatArray,
    gravity_g: float,
) -> None:
    """Refuse angles that fit at least ten times better in the other unit."""
    other = math.pi / 180.0 if angles.unit == "rad" else 180.0 / math.pi
    own = _linear_residual(readings, gravity_g * gravity_direction(angles.kind, table))
    rival = _linear_residual(readings, gravity_g * gravity_direction(angles.kind, table * other))
    if own <= 10.0 * rival or own < 1e-3:
        return
    right = "deg" if angles.unit == "rad" else "rad"
    words = {"deg": "degrees", "rad": "radians"}
    raise RefusedError(
        source,
        f"the readings fit the angles within {own * 1e3:.3g} mg in {words[angles.unit]}, within "
        f"{rival * 1e3:.3g} mg in {words[right]}",
        expected=f"angles in {words[angles.unit]}",
        remedy=f'{words[right]} taken for {words[angles.unit]}? then angle_unit = "{right}"',
    )


def _axes(readings: FloatArray, force: FloatArray) -> tuple[IntArray, FloatArray]:
    """Along which axis of the table each output lies, and its sign, each (3,)."""
    K = inverse_linear(readings, force).K
    scaled = K / np.linalg.norm(K, axis=1, keepdims=True)
    along = np.abs(scaled).argmax(axis=1)
    return along, np.sign(scaled[np.arange(3), along])


def _in_order(along: IntArray, signs: FloatArray) -> bool:
    return bool((along == np.arange(3)).all()) and abs(signs.sum()) == 3.0


def _refuse_wrong_rows(poses: PoseSet, readings: FloatArray, force: FloatArray) -> None:
    """Refuse rows that turn the axes of all: on a narrow grid a few gross ones do."""
    own = _linear_residual(readings, force)
    kept = list(range(len(force)))
    for _ in range(len(force) // 5):
        rest = [[i for i in kept if i != k] for k in kept]
        left = [_linear_residual(readings[part], force[part]) for part in rest]
        best = int(np.argmin(left))
        kept = rest[best]
        if left[best] < own / 10.0 and _in_order(*_axes(readings[kept], force[kept])):
            wrong = [poses.poses[k] for k in range(len(force)) if k not in kept]
            numbers = " and ".join(f"pose {pose.number}" for pose in wrong)
            raise RefusedError(
                f"{poses.source}, line {wrong[0].line}",
                f"{numbers} contradict{'s' * (len(wrong) == 1)} the others: all fit the angles "
                f"within {own * 1e3:.3g} mg rms, the others within {left[best] * 1e3:.3g} mg",
                expected="angles and readings of one position in each row",
                remedy="check angles and readings, and correct or remove the row",
            )


def known_force(
    unit: UnitDescription, poses: PoseSet, layout: RecordingLayout, table: FloatArray
) -> tuple[FloatArray, float]:
    """Known forces, (n, 3), and their sign; refuses exchanged, turned or inverted axes.

    Which way angles count gravity is the reading's own convention: their forces get the sign that
    makes K as `[sensor] polarity` says, positive by default. A direction is upward, so its sign is
    known.
    """
    angles, readings = layout.angles, poses.readings
    assert angles is not None
    force = unit.gravity_g * gravity_direction(angles.kind, table)
    along, shown = _axes(readings, force)
    signs = shown * (unit.polarity or (1, 1, 1))
    if _in_order(along, signs) and (signs[0] > 0.0 or not angles.vectors):
        return force * signs[0], float(signs[0])
    _refuse_wrong_rows(poses, readings, force)
    stated = unit.polarity or (1, 1, 1)
    axes = ", ".join(f"{'-' * (sign < 0)}{axis}" for axis, sign in zip(AXES, stated, strict=True))
    found = ", ".join(
        f"{AXES[i]} along {'+' if shown[i] > 0 else '-'}{AXES[along[i]]}" for i in range(3)
    )
    raise RefusedError(
        poses.source,
        f"the sensing axes lie {found} of the table",
        expected=f"x, y, z along {axes}" + ", or all the other way" * (not angles.vectors),
        remedy=_turned_remedy(layout, along, signs, vectors=angles.vectors),
    )


def _turned_remedy(
    layout: RecordingLayout, along: IntArray, signs: FloatArray, *, vectors: bool
) -> str:
    """What to do about axes along `along` of the table, of these signs, each (3,).

    The columns that are offered make all signs those of the forces as stated. To offer the other
    sign of all three would turn the rotation of two into the inversion of one.
    """
    if sorted(along.tolist()) != [0, 1, 2]:
        return "check the angles and the columns of [recording] acceleration"
    turned = np.zeros((3, 3))
    turned[np.arange(3), along] = signs
    # The output whose axis lies along x of the table is the first column, and so on.
    where = [int(np.flatnonzero(along == k)[0]) for k in range(3)]
    columns = turned_columns(layout, where, [signs[i] < 0.0 for i in where])
    what = "directions" if vectors else "angles"
    in_place = (along == np.arange(3)).all()
    if in_place and signs.sum() == -3.0:
        return (
            "direction is the upward one; if it is, the outputs are inverted: state [sensor] "
            f"polarity, or {columns}"
        )
    if np.linalg.det(turned) < 0.0:
        head = "left-handed axes? "
    elif in_place:
        head = f"half a turn of the sensor about {AXES[int(np.argmax(signs))]}? "
    else:
        head = "a turned sensor? "
    return f"{head}the {what} may be of other axes; if they are right, {columns}"
