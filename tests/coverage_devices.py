"""Simulated devices, calibrated from poses, and their stated 95 % intervals against the truth."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import triaxcal
from triaxcal.fitting.core.noise import NOISE
from triaxcal.fitting.core.posterior import NORMAL_95
from triaxcal.model.terms import products
from triaxcal.model.types import FloatArray
from triaxcal.uncertainty.device_sources import Device
from triaxcal.uncertainty.evaluate import LENGTH, uncertainty
from triaxcal.unit.description import unit_of_text
from triaxcal.unit.priors import Priors

UNIT = """format = 1
serial = "SIM"
[site]
local_gravity_m_per_s2 = 9.80665
[adc]
bits = 24
lsb = 2.384185791015625e-07
[limits]
at_t0_g = 1.0
over_range_g = 1.0
{more}
[recording]
file = "log.csv"
rows = "poses"
acceleration = ["x", "y", "z"]
acceleration_unit = "g"
"""
NO_SQUARES = """[priors]
own_square_g_per_g2 = 1e-6
product_g_per_g2 = 1e-6
"""
ASKED = 40
"""Random orientations at which the delivered acceleration is compared."""
NINE = {"scale": [0, 4, 8], "cross": [1, 2, 5], "bias": [9, 10, 11]}
"""Of the twelve constants, those of a symmetric K."""
KINDS = ("scale", "cross", "bias", "square", "component", "length", "C")
_OWN = ("Qx.xx", "Qy.yy", "Qz.zz")


@dataclass(frozen=True)
class Sensor:
    """A device: symmetric K (3, 3), bias (3,), Q (3, 6), and the noise of |a| in a pose, in g."""

    K: FloatArray
    bias: FloatArray
    Q: FloatArray
    noise_g: float

    def readings(self, force: FloatArray) -> FloatArray:
        """Readings at forces (n, 3), by fixed-point iteration of a = v + Q p(v)."""
        linear = force
        for _ in range(40):
            linear = force - products(linear) @ self.Q.T
        result: FloatArray = linear @ self.K.T + self.bias
        return result


def drawn(random: np.random.Generator, *, squares: bool) -> Sensor:
    """A device of the default priors, its noise too."""
    p = Priors()
    K = np.eye(3) + np.diag(p.scale_factor * random.standard_normal(3))
    upper = np.triu_indices(3, 1)
    K[upper] = p.cross_term_rad * random.standard_normal(3)
    K = np.triu(K) + np.triu(K, 1).T
    K *= 1.0 + 0.05 * random.standard_normal()
    bias = p.bias_g * random.standard_normal(3)
    Q = np.zeros((3, 6))
    if squares:
        Q = p.product_g_per_g2 * random.standard_normal((3, 6))
        Q[np.arange(3), np.arange(3)] = p.own_square_g_per_g2 * random.standard_normal(3)
    noise_g = 0.0
    while noise_g < NOISE.least:
        noise_g = NOISE.median * np.exp(NOISE.spread * random.standard_normal())
    return Sensor(K, bias, Q, float(noise_g))


FAR: Mapping[str, Callable[[Sensor], Sensor]] = {
    "biases of 0.3 g": lambda s: replace(s, bias=np.array([0.3, -0.3, 0.3])),
    "K 1.3 times": lambda s: replace(s, K=1.3 * s.K),
    "scale factors +-6 %": lambda s: replace(s, K=s.K @ np.diag([1.06, 0.94, 1.0])),
    "own squares of 20 mg/g^2": lambda s: replace(s, Q=s.Q + 0.02 * np.eye(3, 6)),
    "cross terms of 40 mrad": lambda s: replace(s, K=s.K + 0.04 * (1.0 - np.eye(3))),
    "noise of 0.3 mg": lambda s: replace(s, noise_g=3e-4),
    "noise of 1 mg": lambda s: replace(s, noise_g=1e-3),
    "noise of 4 mg": lambda s: replace(s, noise_g=4e-3),
}
"""Devices that the priors do not expect: what is else drawn from them, but for one thing."""


def faces_and_more(count: int, random: np.random.Generator) -> FloatArray:
    """Six faces first, then random directions, unit vectors (count, 3)."""
    faces = np.concatenate([np.eye(3), -np.eye(3)])
    more = random.standard_normal((max(count - 6, 0), 3))
    more /= np.linalg.norm(more, axis=1, keepdims=True)
    return np.concatenate([faces, more])[:count]


def covered(
    seed: int, count: int, *, squares: bool, far: str = "", stated: str | None = None
) -> dict[str, FloatArray]:
    """Whether the truth lies in the stated intervals, by `KINDS`.

    Parameters
    ----------
    far : str
        Key of `FAR`.
    stated : str or None
        [priors] of the unit; None states whether there are squares.
    """
    random = np.random.default_rng(seed)
    sensor = drawn(random, squares=squares)
    sensor = FAR[far](sensor) if far else sensor
    poses = faces_and_more(count, random)
    # Noise of |a|: along the force alone, as the fit sees it.
    noise = sensor.noise_g * random.standard_normal((count, 1))
    seen = sensor.readings(poses) + noise * (poses @ sensor.K.T)
    more = ("" if squares else NO_SQUARES) if stated is None else stated
    text = UNIT.format(more=more)
    unit = triaxcal.Unit.of(unit_of_text("SIM", text, "SIM"), None)
    calibration = triaxcal.fit(unit, {name: seen[:, k] for k, name in enumerate("xyz")})
    asked = random.standard_normal((ASKED, 3))
    asked /= np.linalg.norm(asked, axis=1, keepdims=True)
    return {
        **_of_constants(sensor, calibration),
        **_of_force(sensor, calibration, asked),
    }


def _of_constants(sensor: Sensor, calibration: triaxcal.Calibration) -> dict[str, FloatArray]:
    done = calibration.fitted
    found = uncertainty(done.unit, done.measurements, done.calibration, None, np.array([20.0]))
    K, bias = calibration.constants(20.0)
    error = np.concatenate([(K - sensor.K).ravel(), bias - sensor.bias])
    inside = np.abs(error) <= found.constants_u[0]
    assert done.calibration.recording is not None
    shares = {s.name: s for s in done.calibration.recording.shares}
    own = [shares[name] for name in _OWN if name in shares]
    square = [abs(s.value - sensor.Q[k, k]) <= NORMAL_95 * s.sd for k, s in enumerate(own)]
    # Where there are none, and [priors] says so, an interval about 0 holds 0.
    known = done.unit.priors.own_square_g_per_g2 < 1e-4
    return {
        **{kind: inside[rows] for kind, rows in NINE.items()},
        "square": np.array([] if known else square),
    }


def _of_force(
    sensor: Sensor, calibration: triaxcal.Calibration, asked: FloatArray
) -> dict[str, FloatArray]:
    """Components and length of the acceleration: by the floats, and the length by the integers."""
    readings, done = sensor.readings(asked), calibration.fitted
    firmware = triaxcal.firmware(calibration)
    plan = firmware.plan
    device = Device(plan.shape.output_q, firmware.bound.per_axis_lsb, firmware.model_error_g)
    found = uncertainty(done.unit, done.measurements, done.calibration, device, np.array([20.0]))
    u = found.force_u_in(asked)[0]
    force = calibration.apply(readings, 20.0)
    codes = np.rint(readings / done.unit.adc.volts_per_code).astype(np.int64)
    thermometer = done.unit.temperature_sensor
    temp_code = round((20.0 - thermometer.degc_at_zero) / thermometer.degc_per_code)
    accel, _ = firmware.apply(codes, temp_code)
    of_c = np.linalg.norm(accel * firmware.lsb_g, axis=1) - 1.0
    return {
        "component": (np.abs(force - asked) <= u[:, :3]).ravel(),
        "length": np.abs(np.linalg.norm(force, axis=1) - 1.0) <= u[:, LENGTH],
        "C": np.abs(of_c) <= u[:, LENGTH],
    }


Shares = Mapping[str, float]
"""Of the truths inside, by `KINDS`."""


def shares(seeds: Sequence[int], count: int, **kind: Any) -> Shares:
    """Shares of devices that `covered` makes."""
    found = [covered(seed, count, **kind) for seed in seeds]
    every = {name: np.concatenate([f[name] for f in found]) for name in KINDS}
    return {name: float(inside.mean()) for name, inside in every.items() if inside.size}
