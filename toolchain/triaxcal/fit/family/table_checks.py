"""What is wrong with poses whose angles are known, each fault with what to do; and their forces."""

from __future__ import annotations

import math

import numpy as np

from triaxcal.errors import RefusedError
from triaxcal.fit.family.checks import CONDITION_MAX
from triaxcal.fit.family.oriented import design_condition, inverse_linear
from triaxcal.fit.grouping import GROUP_GAP_DEGC
from triaxcal.model.orientation import gravity_direction
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray
from triaxcal.recording.poses import PoseSet
from triaxcal.recordinglayout import Angles
from triaxcal.unitfile import UnitDescription


def refuse_few_poses(poses: PoseSet) -> None:
    """Refuse fewer poses than leave some to check on."""
    if len(poses.poses) < 6:
        raise RefusedError(
            poses.source,
            f"{len(poses.poses)} pose{'s' * (len(poses.poses) != 1)} with angles",
            expected="6 at least: four constants an output, and some to check on",
            remedy="measure more positions",
        )


def refuse_open(poses: PoseSet, direction: FloatArray) -> None:
    """Refuse angles that leave a constant open."""
    condition = design_condition(direction)
    if condition > CONDITION_MAX:
        raise RefusedError(
            poses.source,
            f"the angles of the {len(poses.poses)} poses leave constants open (condition number "
            f"{condition:.3g})",
            expected=f"{CONDITION_MAX:g} at most",
            remedy="add poses over both angles",
        )


def one_temperature(unit: UnitDescription, poses: PoseSet) -> FloatArray:
    """Temperatures of the poses, (n,), which must be one; T0 where none was recorded."""
    recorded = poses.temps_degc
    temps = np.full(len(poses.poses), unit.t0_degc) if recorded is None else recorded
    if np.ptp(temps) > GROUP_GAP_DEGC:
        raise RefusedError(
            poses.source,
            f"poses with angles at {temps.min():.4g} to {temps.max():.4g} degC",
            expected=f"one temperature, within {GROUP_GAP_DEGC:g} degC",
            remedy="make a unit of each temperature, or leave out the angles: the poses are then "
            "fitted over temperature by |a| = g alone",
        )
    if unit.thermal.order:
        raise RefusedError(
            f"{unit.name}/unit.toml, [thermal] order",
            f"order {unit.thermal.order}, but all poses are at one temperature",
            expected="0",
        )
    return temps


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
    source: str, angles: Angles, readings: FloatArray, table: FloatArray, gravity_g: float
) -> tuple[FloatArray, float]:
    """Known forces, (n, 3), with the sign of the readings; refuses exchanged or turned axes."""
    force = gravity_g * gravity_direction(angles.kind, table)
    K = inverse_linear(readings, force).K
    scaled = K / np.linalg.norm(K, axis=1, keepdims=True)
    along = np.abs(scaled).argmax(axis=1)
    signs = np.sign(scaled[np.arange(3), along])
    if (along == np.arange(3)).all() and abs(signs.sum()) == 3.0:
        return force * signs[0], float(signs[0])
    told = ", ".join(
        f"{AXES[i]} along {'+' if signs[i] > 0 else '-'}{AXES[along[i]]}" for i in range(3)
    )
    turned = np.zeros((3, 3))
    turned[np.arange(3), along] = signs * (np.sign(signs.sum()) or 1.0)
    handed = "left-handed axes? " if np.linalg.det(turned) < 0.0 else ""
    raise RefusedError(
        source,
        f"the outputs look {told} of the table",
        expected="x along x, y along y, z along z, of one sign",
        remedy=f"{handed}exchange columns or turn signs in [recording] acceleration, as "
        '["ay", "-ax", "az"]',
    )
