"""Recordings of a unit that a hand turns from rest to rest, by exact physics.

Between two rests the attitude, body axes to east, north, up, is

    C(t) = C_k exp([a] p(t)) exp([b] q(t)),    rate = exp([b] q)^T a p' + b q',

two turns at once about different axes, p and q smooth steps; the axis of rotation wanders. At the
same time the unit moves along a straight line by another smooth step x(t), so that it feels
C^T (x'' + 2 u x x' + g) and turns at rate + C^T u against inertial space. Nothing is integrated.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from dynamic_cases import recording_of, sheet
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.recording import ImuRecording, ImuSamples
from triaxcal.simulation.imu_grades import GRADES, draw_truth
from triaxcal.simulation.imu_truth import ImuTruth

LATITUDE_DEG, GRAVITY = 50.0, 9.8107
EARTH = 7.292115e-5 * np.array(
    [0.0, np.cos(np.radians(LATITUDE_DEG)), np.sin(np.radians(LATITUDE_DEG))]
)


@dataclass(frozen=True)
class Hand:
    """How the hand works.

    Attributes
    ----------
    poses : int
    start_s, rest_s : float, two floats
        First rest; shortest and longest of the others.
    turn_s : two floats
    turn_deg : two floats
        About the main axis; the other turn is up to a third of it.
    push_m_per_s2 : float
        Largest acceleration of the usual movement between two rests.
    rate_hz : float
    """

    poses: int = 37
    start_s: float = 50.0
    rest_s: tuple[float, float] = (1.0, 4.0)
    turn_s: tuple[float, float] = (1.0, 2.5)
    turn_deg: tuple[float, float] = (60.0, 180.0)
    push_m_per_s2: float = 0.5
    rate_hz: float = 100.0


STEP = np.polynomial.Polynomial([0, 0, 0, 0, 35, -84, 70, -20])
"""From 0 to 1 while its argument does, three derivatives zero at both ends."""
STEP_PEAK = 7.513
"""Largest second derivative of it."""


def smooth(time_s: np.ndarray, start_s: float, span_s: float) -> tuple[np.ndarray, ...]:
    """The step from `start_s` to `start_s + span_s`, and its first two derivatives, shape (n,)."""
    at = np.clip((time_s - start_s) / span_s, 0.0, 1.0)
    return STEP(at), STEP.deriv(1)(at) / span_s, STEP.deriv(2)(at) / span_s**2


def turn(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """exp([axis] angle) by Rodrigues, shape (n, 3, 3)."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return (
        np.eye(3) + np.sin(angle)[:, None, None] * K + (1 - np.cos(angle))[:, None, None] * (K @ K)
    )


def motion(hand: Hand, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times (n,), true rates against inertial space (n, 3) and true specific forces (n, 3)."""
    draw = np.random.default_rng([seed, 77])

    def direction() -> np.ndarray:
        vector = draw.normal(size=3)
        return vector / np.linalg.norm(vector)

    C = turn(direction(), np.array([draw.uniform(0.0, 3.0)]))[0]
    pieces, begin, rest = [], 0.0, hand.start_s
    for _ in range(hand.poses - 1):
        span = draw.uniform(*hand.turn_s)
        main = np.radians(draw.uniform(*hand.turn_deg)) * draw.choice([-1.0, 1.0])
        pieces.append((begin, begin + rest, span, C, direction(), direction(), main,
                       main * draw.uniform(-1.0, 1.0) / 3, direction() * hand.push_m_per_s2
                       * draw.uniform(0.4, 1.0) * span**2 / STEP_PEAK))  # fmt: skip
        a, b, p, q = pieces[-1][4:8]
        C = C @ turn(a, np.array([p]))[0] @ turn(b, np.array([q]))[0]
        begin, rest = begin + rest + span, draw.uniform(*hand.rest_s)
    end = begin + rest
    time = np.arange(1, int(end * hand.rate_hz)) / hand.rate_hz
    rate, force = np.zeros((2, len(time), 3))
    up = np.array([0.0, 0.0, GRAVITY])
    for k, (start, go, span, C_k, a, b, p, q, way) in enumerate(pieces):
        last = k + 1 == len(pieces)
        inside = (time >= start) & (time < (np.inf if last else go + span))
        s, ds, dds = smooth(time[inside], go, span)
        second = turn(b, q * s)
        C_t = C_k @ turn(a, p * s) @ second
        velocity, acceleration = way * ds[:, None], way * dds[:, None]
        outside = acceleration + 2 * np.cross(EARTH, velocity) + up
        relative = np.einsum("nji,j->ni", second, a) * (p * ds)[:, None] + b * (q * ds)[:, None]
        rate[inside] = relative + np.einsum("nji,j->ni", C_t, EARTH)
        force[inside] = np.einsum("nji,nj->ni", C_t, outside)
    return time, rate, force


def record(truth: ImuTruth, hand: Hand, seed: int) -> ImuRecording:
    """What a unit reads at each instant: its errors and white noise."""
    time, rate, force = motion(hand, seed)
    noise, root = stated(truth), np.sqrt(hand.rate_hz)
    draw = np.random.default_rng([seed, 78])
    bias = np.radians(truth.gyro_bias_deg_per_h) / 3600
    read_rate = rate + rate @ truth.gyro_matrix().T + bias
    read_rate += draw.normal(size=rate.shape) * noise.rate_density * root
    read_force = (
        force + force @ truth.accel_matrix().T + 1e-3 * np.array(truth.accel_bias_mm_per_s2)
    )
    read_force += draw.normal(size=force.shape) * noise.force_density() * root
    samples = ImuSamples(time, read_rate, read_force)
    about = {"latitude_deg": LATITUDE_DEG, "gravity_m_per_s2": GRAVITY}
    return recording_of(samples, f"hand, seed {seed}", rate_hz=hand.rate_hz, **about)


def stated(truth: ImuTruth) -> DataSheet:
    """The noise of the unit: white alone; `record` counts nothing."""
    return replace(sheet(truth), accel_lsb=0.0, table_sd_arcsec=None)


@cache
def hand_short() -> tuple[ImuTruth, ImuRecording]:
    """MEMS grade, two dozen poses."""
    truth = draw_truth(GRADES["mems"], 1)
    return truth, record(truth, Hand(poses=24, start_s=10.0), 1)
