"""A unit turned by hand between poses: a perfect recording of rests and turns, for plans.

Each turn is about an axis that is fixed in the unit, by an angle that follows a smooth step of the
fifth degree in time, so that rate and force are exact at every time. In increments a sample is the
integral by Simpson's rule; the error at the rates of a hand is far below any noise.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from triaxcal.dynamic.recording import INCREMENT, ImuRecording, ImuSamples
from triaxcal.model.types import FloatArray

EARTH_RATE_RAD_PER_S = 7.292115e-5
FIRST_REST_S = 20.0
REST_S, TURN_S = 4.0, 2.5
_S = math.sqrt(0.5)
_TURNS = (
    ((1.0, 0.0, 0.0), 90.0),
    ((0.0, 1.0, 0.0), 90.0),
    ((0.0, 0.0, 1.0), 180.0),
    ((1.0, 0.0, 0.0), -180.0),
    ((0.0, 1.0, 0.0), 180.0),
    ((0.0, 0.0, 1.0), -90.0),
    ((_S, _S, 0.0), 120.0),
    ((1.0, 0.0, 0.0), 360.0),
    ((0.0, _S, _S), -135.0),
    ((0.0, 1.0, 0.0), -360.0),
    ((_S, 0.0, _S), 150.0),
    ((0.0, 0.0, 1.0), 360.0),
    ((_S, -_S, 0.0), -45.0),
)
"""Axis in the unit and angle in deg of the turns, over and over: every axis in both senses, whole
turns for the scale factors, and attitudes with gravity along every direction."""


@dataclass(frozen=True)
class HandMotion:
    """Poses held for `REST_S`, turns of `TURN_S` between them.

    Attributes
    ----------
    poses : int
    latitude_deg, gravity_m_per_s2 : float
    """

    poses: int
    latitude_deg: float
    gravity_m_per_s2: float

    @property
    def duration_s(self) -> float:
        """From the first sample to the last."""
        return FIRST_REST_S + (self.poses - 1) * (REST_S + TURN_S)

    def attitudes(self) -> FloatArray:
        """Rotation from unit axes to east, north, up in each pose, shape (poses, 3, 3)."""
        found = [np.eye(3)]
        for k in range(self.poses - 1):
            axis, angle_deg = _TURNS[k % len(_TURNS)]
            found.append(found[-1] @ _rotation(np.array(axis) * math.radians(angle_deg)))
        return np.array(found)

    def at(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Rate against inertial space, rad/s, and force, m/s^2, on the unit's axes; (n, 3) each."""
        since = np.clip(time_s - FIRST_REST_S, 0.0, None)
        turn = np.minimum((since // (TURN_S + REST_S)).astype(np.int64), self.poses - 1)
        part = np.clip((since - turn * (TURN_S + REST_S)) / TURN_S, 0.0, 1.0)
        which = turn % len(_TURNS)
        axis = np.array([a for a, _ in _TURNS])[which]
        angle = np.radians(np.array([d for _, d in _TURNS]))[which]
        angle = np.where(turn < self.poses - 1, angle, 0.0)
        done = part**3 * (10 - 15 * part + 6 * part**2)
        speed = angle * 30 * part**2 * (1 - part) ** 2 / TURN_S
        attitude = self.attitudes()[turn] @ _rotation(axis * (angle * done)[:, None])
        latitude = math.radians(self.latitude_deg)
        earth = EARTH_RATE_RAD_PER_S * np.array([0.0, math.cos(latitude), math.sin(latitude)])
        rate: FloatArray = axis * speed[:, None] + np.einsum("nji,j->ni", attitude, earth)
        force: FloatArray = attitude[:, 2, :] * self.gravity_m_per_s2
        return rate, force


def _rotation(vector_rad: FloatArray) -> FloatArray:
    """Matrix, shape (..., 3, 3), of a rotation vector, shape (..., 3), by Rodrigues' formula."""
    angle = np.linalg.norm(vector_rad, axis=-1)[..., None, None]
    x, y, z = np.moveaxis(vector_rad, -1, 0)
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1)
    cross = cross.reshape(*vector_rad.shape, 3)
    matrix: FloatArray = (
        np.eye(3)
        + np.sinc(angle / np.pi) * cross
        + 0.5 * np.sinc(angle / 2 / np.pi) ** 2 * (cross @ cross)
    )
    return matrix


def hand_recording(
    motion: HandMotion, rate_hz: float, conventions: tuple[str, str], degc: float
) -> ImuRecording:
    """Perfect readings of a motion, at one temperature; samples at 1/rate, 2/rate, ...

    `conventions` are those of rate and force.
    """

    def pieces() -> Iterator[ImuSamples]:
        time_s = np.arange(1, round(motion.duration_s * rate_hz) + 1) / rate_hz
        step_s = 1 / rate_hz
        end, middle, start = (motion.at(time_s - part * step_s) for part in (0.0, 0.5, 1.0))
        rate, force = (
            (a + 4 * b + c) * step_s / 6 if convention == INCREMENT else a
            for a, b, c, convention in zip(end, middle, start, conventions, strict=True)
        )
        yield ImuSamples(time_s, rate, force, np.full(len(time_s), degc))

    return ImuRecording(
        name="planned turns by hand",
        pieces=pieces,
        rate_hz=rate_hz,
        latitude_deg=motion.latitude_deg,
        gravity_m_per_s2=motion.gravity_m_per_s2,
        rate_convention=conventions[0],
        force_convention=conventions[1],
    )
