"""Diagnostics of P0, section 2: full turns, and whether azimuth matters.

Over a full turn about one angle each reading is a + b cos t + c sin t: the mean a is the bias, the
amplitude the scale factor. What is left at twice the angle is not linear. A dependence on azimuth
points, in the paper's words, at (a) the computation, (b) the level of the table's plane, or (c)
axes that are far from orthogonal or badly set: (b) turns with the azimuth once, and so shows as its
first harmonic; (a) and (c) do not turn with it as a tilt does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.model.orientation import direction_cosines, gravity_direction
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray
from triaxcal.unit.recording import ANGLE_NAMES, Angles

_SAME_RAD = np.radians(0.01)
_LARGEST_STEP = np.radians(100.0)
"""Wider steps cannot separate the second harmonic from the first."""
_SEEN = 4.0
"""Standard errors: what an azimuth must do to be named."""


@dataclass(frozen=True)
class Turn:
    """Harmonics of the readings over a full turn about one angle.

    Attributes
    ----------
    mean, amplitude, second : arrays, shape (3,)
        Per output, in its unit: bias, first and second harmonic.
    rms : array, shape (3,)
        Of what is left.
    """

    mean: FloatArray
    amplitude: FloatArray
    second: FloatArray
    rms: FloatArray


def full_turn(angle_rad: FloatArray, readings: FloatArray) -> Turn | None:
    """Harmonics of readings (n, 3) at angles (n,); None unless they go all the way round."""
    order = np.argsort(angle_rad % (2.0 * np.pi))
    steps = np.diff(np.append(angle_rad[order], angle_rad[order][:1] + 2.0 * np.pi) % (2 * np.pi))
    if len(angle_rad) < 6 or float((steps % (2.0 * np.pi)).max()) > _LARGEST_STEP:
        return None
    t = angle_rad
    design = np.stack([np.ones_like(t), np.cos(t), np.sin(t), np.cos(2 * t), np.sin(2 * t)], 1)
    solution = np.linalg.lstsq(design, readings, rcond=None)[0]
    left = readings - design @ solution
    return Turn(
        mean=solution[0],
        amplitude=np.hypot(solution[1], solution[2]),
        second=np.hypot(solution[3], solution[4]),
        rms=np.sqrt(np.mean(left**2, axis=0)),
    )


def table_findings(
    angles: Angles,
    table: FloatArray,
    readings: FloatArray,
    force: FloatArray,
    gravity_g: float,
) -> list[str]:
    """Findings of section 2 for a grid of poses: its full turns, and its azimuths.

    `force` is what the fitted constants give, in the sign of the table's gravity.
    """
    findings = []
    for k, name in enumerate(ANGLE_NAMES[angles.kind][:2]):
        other = table[:, 1 - k]
        for value in np.unique(np.round(other / _SAME_RAD)) * _SAME_RAD:
            part = np.abs(other - value) < _SAME_RAD
            turn = full_turn(table[part, k], readings[part])
            if turn is not None:
                findings.append(_turn_words(turn, name, int(part.sum())))
    return [*findings[:2], *_azimuth(angles, table, force, gravity_g)]


def _turn_words(turn: Turn, name: str, count: int) -> str:
    parts = [
        f"{AXES[i]} mean {turn.mean[i]:.5g}, amplitude {turn.amplitude[i]:.5g}, twice the angle "
        f"{turn.second[i]:.2g}"
        for i in range(3)
    ]
    return f"full turn of {name.replace('_', ' ')} ({count} poses): " + "; ".join(parts)


def _azimuth(angles: Angles, table: FloatArray, force: FloatArray, gravity_g: float) -> list[str]:
    """How the residuals depend on azimuth: not, as with a tilted plane, or otherwise."""
    if table.shape[1] < 3 or np.ptp(table[:, 2]) < np.radians(60.0):
        return []
    residual = force - gravity_g * gravity_direction(angles.kind, table)
    tilt, explained, rest = plane_tilt(angles.kind, table, residual, gravity_g)
    n = residual.size
    noise = rest * np.sqrt(2.0 / n) / gravity_g
    size = float(np.hypot(*tilt))
    arcsec = np.degrees(size) * 3600.0
    if size > _SEEN * noise and explained > 0.5:
        tilted = f"the table's plane is out of level by {arcsec:.3g} arcsec; level it"
        return [f"the residuals depend on azimuth, check (b): {tilted}"]
    by_angle = _first_harmonic(table[:, 2], residual)
    if by_angle > _SEEN * rest * np.sqrt(2.0 / len(residual)):
        size_mg = by_angle * 1e3
        where = "check the computation of the angles, then the alignment of the axes"
        depends = f"the residuals depend on azimuth by {size_mg:.3g} mg, not as a tilt of the plane"
        return [f"{depends}, checks (a) and (c): {where}"]
    return ["the residuals do not depend on azimuth; checks (a), (b), (c) passed"]


def plane_tilt(
    kind: str, table: FloatArray, residual: FloatArray, gravity_g: float
) -> tuple[FloatArray, float, float]:
    """Tilt of the table's plane about the two horizontal axes, (2,) rad, from residuals (n, 3), g.

    Also the share of the residuals' squares that it explains, and the rms that is left.
    """
    matrix = direction_cosines(kind, table)
    # The plumb line turned by small e_x, e_y: Z moves by e_y X - e_x Y.
    design = gravity_g * np.stack([-matrix[:, :, 1], matrix[:, :, 0]], axis=-1).reshape(-1, 2)
    right = residual.ravel()
    tilt: FloatArray = np.linalg.lstsq(design, right, rcond=None)[0].astype(np.float64)
    left = right - design @ tilt
    total = float(right @ right) or 1.0
    return tilt, 1.0 - float(left @ left) / total, float(np.sqrt(np.mean(left**2)))


def _first_harmonic(angle: FloatArray, residual: FloatArray) -> float:
    design = np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=1)
    solution = np.linalg.lstsq(design, residual, rcond=None)[0]
    return float(np.hypot(solution[1], solution[2]).max())
