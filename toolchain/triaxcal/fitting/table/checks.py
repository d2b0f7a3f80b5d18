"""What is wrong with poses whose angles are known, each fault with what to do; and their forces."""

from __future__ import annotations

import math

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.outliers import worst_outlier
from triaxcal.fitting.recorded.checks import CONDITION_MAX, turned_columns
from triaxcal.fitting.recorded.temperatures import temperature_groups
from triaxcal.fitting.table.candidates import TableRow
from triaxcal.fitting.table.oriented import design_condition, inverse_linear
from triaxcal.model.orientation import angles_from_force, gravity_direction
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray
from triaxcal.poses.poses import PoseSet
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.recording import ANGLE_NAMES, Angles, RecordingLayout


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


def known_force(
    source: str,
    layout: RecordingLayout,
    readings: FloatArray,
    table: FloatArray,
    gravity_g: float,
) -> tuple[FloatArray, float]:
    """Known forces, (n, 3), with the sign of the readings; refuses exchanged or turned axes."""
    angles = layout.angles
    assert angles is not None
    force = gravity_g * gravity_direction(angles.kind, table)
    K = inverse_linear(readings, force).K
    scaled = K / np.linalg.norm(K, axis=1, keepdims=True)
    along = np.abs(scaled).argmax(axis=1)
    signs = np.sign(scaled[np.arange(3), along])
    if (along == np.arange(3)).all() and abs(signs.sum()) == 3.0:
        return force * signs[0], float(signs[0])
    found = ", ".join(
        f"{AXES[i]} along {'+' if signs[i] > 0 else '-'}{AXES[along[i]]}" for i in range(3)
    )
    turned = np.zeros((3, 3))
    turned[np.arange(3), along] = signs * (np.sign(signs.sum()) or 1.0)
    handed = "left-handed axes? " if np.linalg.det(turned) < 0.0 else ""
    columns = ""
    if sorted(along.tolist()) == [0, 1, 2]:
        # The output whose axis lies along x of the table is the first column, and so on.
        where = [int(np.flatnonzero(along == k)[0]) for k in range(3)]
        columns = turned_columns(layout, where, [turned[i, along[i]] < 0.0 for i in where])
    raise RefusedError(
        source,
        f"the sensing axes lie {found} of the table",
        expected="x along x, y along y, z along z, of one sign",
        remedy=f"{handed}the angles may be of other axes; if they are right, {columns}"
        if columns
        else "check the angles and the columns of [recording] acceleration",
    )


def outlier_findings(
    unit: UnitDescription,
    angles: Angles,
    poses: PoseSet,
    *,
    table: FloatArray,
    sign: float,
    best: TableRow,
) -> list[str]:
    """Names a pose whose angles the other poses contradict; refuses it beyond the limit."""
    count = len(best.own_g)
    if best.errors_g is None:
        return []
    left_out = best.errors_g[:count]
    found = worst_outlier(best.own_g, left_out, best.trial.parameters)
    if found is None:
        return []
    k = found.indices[0]
    away = float(np.linalg.norm(left_out[k]))
    known = unit.gravity_g * gravity_direction(angles.kind, table[k : k + 1])
    seen = angles_from_force(angles.kind, known + sign * left_out[k : k + 1])[0]
    words = [name.replace("_", " ") for name in ANGLE_NAMES[angles.kind][:2]]
    stated = ", ".join(f"{w} {v:.5g}" for w, v in zip(words, np.degrees(table[k, :2]), strict=True))
    fitted = ", ".join(f"{w} {v:.5g}" for w, v in zip(words, np.degrees(seen), strict=True))
    pose = poses.poses[k]
    rivals = "".join(f" or pose {poses.poses[i].number}" for i in found.indices[1:4])
    text = (
        f"pose {pose.number}{rivals} contradicts the others: the file has {stated} deg, the "
        f"fit of the others gives {fitted} deg; the difference is {away * 1e3:.3g} mg, the "
        f"residuals of the others are {found.others * 1e3:.2g} mg rms"
    )
    remedy = "check its angles and readings, and correct or remove the row"
    temp = unit.t0_degc if pose.temp_degc is None else pose.temp_degc
    limit, key = unit.limits.at(temp, unit.t0_degc)
    if away <= limit:
        return [f"{text}; {remedy}"]
    raise RefusedError(
        f"{poses.source}, line {pose.line}",
        text,
        expected=f"at most {limit * 1e3:g} mg ({key})",
        remedy=remedy,
    )
