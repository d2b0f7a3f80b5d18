"""Simulated devices drawn from the priors, calibrated, and their intervals against the truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from triaxcal.fitting.core.noise import NOISE
from triaxcal.fitting.route import calibrate_recording
from triaxcal.model.metrological import force_from_voltage
from triaxcal.model.terms import products
from triaxcal.model.types import FloatArray
from triaxcal.uncertainty.evaluate import uncertainty
from triaxcal.unit.description import unit_of_text
from triaxcal.unit.priors import Priors

UNIT = """format = 1
serial = "SIM"
[site]
local_gravity_m_per_s2 = 9.80665
[priors]
own_square_g_per_g2 = {own:g}
product_g_per_g2 = {product:g}
{more}
[recording]
file = "log.csv"
rows = "poses"
acceleration = ["x", "y", "z"]
acceleration_unit = "g"
"""
ASKED = 40
"""Random orientations at which the delivered acceleration is compared."""


@dataclass(frozen=True)
class Covered:
    """How often the truth lies in the 95 % intervals of one device, for each kind of quantity."""

    constants: FloatArray
    components: FloatArray
    lengths: FloatArray


def faces_and_more(count: int, random: np.random.Generator) -> FloatArray:
    """Six faces first, then random directions, unit vectors (count, 3)."""
    faces = np.concatenate([np.eye(3), -np.eye(3)])
    more = random.standard_normal((max(count - 6, 0), 3))
    more /= np.linalg.norm(more, axis=1, keepdims=True)
    return np.concatenate([faces, more])[:count]


def device(seed: int, count: int, *, squares: bool) -> Covered:
    """One device with constants, squares and noise drawn from the priors."""
    random, p = np.random.default_rng(seed), Priors()
    K = np.eye(3) + np.diag(p.scale_factor * random.standard_normal(3))
    upper = np.triu_indices(3, 1)
    K[upper] = p.cross_term_rad * random.standard_normal(3)
    K = np.triu(K) + np.triu(K, 1).T
    K *= 1.0 + 0.05 * random.standard_normal()
    bias = p.bias_g * random.standard_normal(3)
    Q = np.zeros((3, 6))
    own, product = (p.own_square_g_per_g2, p.product_g_per_g2) if squares else (1e-6, 1e-6)
    if squares:
        Q = product * random.standard_normal((3, 6))
        Q[np.arange(3), np.arange(3)] = own * random.standard_normal(3)
    sd = NOISE.median * np.exp(NOISE.spread * random.standard_normal())
    sd = max(sd, NOISE.least)

    def readings(force: FloatArray) -> FloatArray:
        linear = force
        for _ in range(20):
            linear = force - products(linear) @ Q.T
        return linear @ K.T + bias

    poses = faces_and_more(count, random)
    seen = readings(poses)
    # Noise of |a|: along the force alone, as the fit sees it.
    seen = seen + sd * random.standard_normal((count, 1)) * poses
    text = UNIT.format(own=own, product=product, more="")
    unit = unit_of_text("SIM", text, "SIM")
    assert unit.recording is not None
    columns = {name: seen[:, k] for k, name in enumerate("xyz")}
    unit, measurements, calibration = calibrate_recording(unit, unit.recording, Path(), columns)
    found = uncertainty(unit, measurements, calibration, None, np.array([20.0]))
    truth = np.concatenate([K.ravel(), bias])
    constants = calibration.thermal.constants_at(20.0)
    independent = [0, 1, 2, 4, 5, 8, 9, 10, 11]
    inside = np.abs(constants - truth) <= found.constants_u[0]
    asked = random.standard_normal((ASKED, 3))
    asked /= np.linalg.norm(asked, axis=1, keepdims=True)
    force = calibration.terms.force_g(force_from_voltage(constants, readings(asked)))
    components, lengths = [], []
    for direction, given in zip(asked, force, strict=True):
        u = [found.force_budget(k, 0, direction).expanded for k in range(4)]
        components.append(np.abs(given - direction) <= u[:3])
        lengths.append(abs(np.linalg.norm(given) - 1.0) <= u[3])
    return Covered(inside[independent], np.array(components).ravel(), np.array(lengths))


def coverage(count: int, devices: int, *, squares: bool, first: int = 0) -> tuple[float, ...]:
    """Share of the truths inside: constants, components of the acceleration, its length."""
    found = [device(first + k, count, squares=squares) for k in range(devices)]
    return tuple(
        float(np.mean([getattr(f, what) for f in found]))
        for what in ("constants", "components", "lengths")
    )
