"""Exact rotation of a simulated IMU: attitude, rate and angular acceleration in closed form.

Every frame is the one before, turned about a fixed axis n by an angle theta(t). With C the matrix
of that turn, the components of a vector, of the absolute rate and of its derivative go over by

    v' = C v,   w' = C w + theta' n,   w'' = C w' + theta'' n - theta' n x w'      (new components)

without any approximation and without integration, so that nothing accumulates. Arrays have the
components first: shape (3, n) for n times.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from triaxcal.model.types import FloatArray
from triaxcal.simulation.imu_motion import ImuMotion, RoughTable
from triaxcal.simulation.imu_truth import ARCSEC

EARTH_RATE_RAD_PER_S = 7.292115e-5
"""WGS 84."""

_WOBBLE = ((1.0, 0.7, 0.3), (2.0, 0.3, 1.9))
"""Harmonic of the table's angle, share of the amplitude, phase."""
_RIPPLE = (3.7, 7.3, 11.9)
_DIAGONAL = (1 / math.sqrt(3.0),) * 3


@dataclass
class BodyMotion:
    """A frame that turns, at n times; all components on the frame's own axes.

    Attributes
    ----------
    up : array, shape (3, n)
        Unit vector of the plumb line, upwards.
    earth : array, shape (3, n)
        Rate of the Earth, rad/s.
    rate, acceleration : array, shape (3, n)
        Absolute angular rate (rad/s) and its derivative (rad/s^2).
    """

    up: FloatArray
    earth: FloatArray
    rate: FloatArray
    acceleration: FloatArray

    def turn(self, axis: tuple[float, float, float], jet: FloatArray) -> None:
        """Go over to axes turned right-handed about `axis` by an angle with a jet (3, n)."""
        if not jet.any():
            return
        angle, speed, speeding = jet
        cosine, sine = np.cos(angle), np.sin(angle)
        self.up = _turned(self.up, axis, cosine, sine)
        self.earth = _turned(self.earth, axis, cosine, sine)
        rate = _turned(self.rate, axis, cosine, sine)
        acceleration = _turned(self.acceleration, axis, cosine, sine)
        across = _cross(np.array(axis)[:, None], rate)
        for i, n in enumerate(axis):
            rate[i] += n * speed
            acceleration[i] += n * speeding - speed * across[i]
        self.rate, self.acceleration = rate, acceleration

    def up_jet(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The plumb line and its two derivatives, on the turning axes."""
        relative = self.rate - self.earth
        # The Earth's rate is constant on the Earth: on the turning axes it turns as up does.
        speeding = self.acceleration + _cross(relative, self.earth)
        first = -_cross(relative, self.up)
        return self.up, first, -_cross(speeding, self.up) - _cross(relative, first)


def _turned(
    vector: FloatArray, axis: tuple[float, float, float], cosine: FloatArray, sine: FloatArray
) -> FloatArray:
    """Components (3, n) on axes turned about the unit vector `axis`."""
    if 1.0 in axis:
        k = axis.index(1.0)
        j, i = (k + 1) % 3, (k + 2) % 3
        result = np.empty_like(vector)
        result[k] = vector[k]
        result[j] = cosine * vector[j] + sine * vector[i]
        result[i] = cosine * vector[i] - sine * vector[j]
        return result
    n = np.array(axis)[:, None]
    along = (n * vector).sum(axis=0)
    turned: FloatArray = cosine * vector - sine * _cross(n, vector) + n * along * (1.0 - cosine)
    return turned


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross products of columns, shape (3, n)."""
    return np.stack(
        (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    )


def body_motion(motion: ImuMotion, elasticity_rad: FloatArray, time_s: FloatArray) -> BodyMotion:
    """Motion of the instrument axes at times (n,).

    `elasticity_rad` (3, 3), rad/g: the unit turns against its mounting, about its axes 1, 2, 3 one
    after the other, by this times the direction of the plumb line on the mounting's axes.
    """
    body = _table_axes(motion, len(time_s))
    plan = motion.table_angle.jet(time_s)
    for axis, wobble in zip(
        ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), _wobble(motion.table, plan), strict=True
    ):
        body.turn(axis, wobble)
    body.turn((1.0, 0.0, 0.0), rippled(motion.table, plan))
    body.turn(_DIAGONAL, motion.mounting_angle.jet(time_s))
    for mounting, present in zip(motion.mountings, motion.present, strict=True):
        size = math.hypot(*mounting.placement_deg)
        if size:
            x, y, z = mounting.placement_deg
            axis = (x / size, y / size, z / size)
            body.turn(axis, math.radians(size) * present.jet(time_s))
    if elasticity_rad.any():
        jets = np.stack([elasticity_rad @ derivative for derivative in body.up_jet()])
        for k in range(3):
            body.turn((float(k == 0), float(k == 1), float(k == 2)), jets[:, k])
    return body


def _table_axes(motion: ImuMotion, n: int) -> BodyMotion:
    """At rest on the Earth: axis 1 along the table's axis, axis 3 as near to up as that allows."""
    azimuth, elevation = (
        math.radians(angle) for angle in (motion.table.azimuth_deg, motion.table.elevation_deg)
    )
    up = np.array([0.0, 0.0, 1.0])
    first = np.array(
        [
            math.sin(azimuth) * math.cos(elevation),
            math.cos(azimuth) * math.cos(elevation),
            math.sin(elevation),
        ]
    )
    third = up - (up @ first) * first
    third /= np.linalg.norm(third)
    table = np.stack((first, np.cross(third, first), third))
    latitude = math.radians(motion.latitude_deg)
    earth = EARTH_RATE_RAD_PER_S * np.array([0.0, math.cos(latitude), math.sin(latitude)])

    def columns(vector: FloatArray) -> FloatArray:
        return np.repeat((table @ vector)[:, None], n, axis=1)

    return BodyMotion(columns(up), columns(earth), columns(earth), np.zeros((3, n)))


def rippled(table: RoughTable, plan: FloatArray) -> FloatArray:
    """Jet of the table's true angle from that of its nominal one, both (3, n)."""
    result = plan.copy()
    if table.ripple_deg:
        size = math.radians(table.ripple_deg) / len(_RIPPLE)
        for harmonic in _RIPPLE:
            result += _harmonic(plan, harmonic, size, -math.pi / 2)
    return result


def _wobble(table: RoughTable, plan: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Jets of the axis' two tilts, each (3, n)."""
    size = ARCSEC * table.wobble_arcsec
    first, second = np.zeros_like(plan), np.zeros_like(plan)
    if size:
        for harmonic, share, phase in _WOBBLE:
            first += _harmonic(plan, harmonic, share * size, phase)
            second += _harmonic(plan, harmonic, share * size, phase - math.pi / 2)
    return first, second


def _harmonic(plan: FloatArray, harmonic: float, size: float, phase: float) -> FloatArray:
    """Jet of size * cos(harmonic * angle + phase)."""
    angle, speed, speeding = plan
    argument = harmonic * angle + phase
    value, slope = size * np.cos(argument), -size * harmonic * np.sin(argument)
    return np.stack((value, slope * speed, slope * speeding - harmonic**2 * value * speed**2))


def force_at(
    body: BodyMotion,
    gravity_m_per_s2: float,
    lift: FloatArray,
    position: tuple[FloatArray, FloatArray, FloatArray],
) -> FloatArray:
    """Specific force at a point that may move in the body, m/s^2, shape (3, n).

    `lift` (3, n): height of the centre above its place on the Earth and its two derivatives.
    `position`: of the point from the centre in m and its two derivatives on the body's axes, each
    (3, n) or (3, 1). Transport, Coriolis and relative terms are complete, the Earth's rate too; the
    Earth's own centripetal acceleration at the centre's place is in gravity.
    """
    height, climbing, lifting = lift
    force: FloatArray = body.up * (gravity_m_per_s2 + lifting)
    if height.any():
        sideways = _cross(body.earth, body.up)
        force += 2.0 * climbing * sideways + height * _cross(body.earth, sideways)
    place, moving, speeding = position
    if place.any():
        force += _cross(body.acceleration, place) + _cross(body.rate, _cross(body.rate, place))
    if moving.any() or speeding.any():
        force += 2.0 * _cross(body.rate, moving) + speeding
    return force
