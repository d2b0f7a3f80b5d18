"""Noise and placement, estimated from the residuals over the positions.

The half-sums over opposite positions, brought to force by N, estimate one bias three times at each
temperature. With the noise v of a reading and the tilts' variance p g^2 about each axis, that of
an axis' own two positions has the variance v / 2, the other two v / 2 + p g^2 / 2. Their sum of
squares about their mean is therefore v + 2 p g^2 / 3, with two degrees of freedom for each axis:

    from temperature to temperature    S_w = 3 (G - 1) (v + 2/3 p_r g^2),    6 (G - 1)
    of the mean over temperatures      S_m = 3 (v / G + 2/3 g^2 (p_r / G + p_s)),    6

p_r is the repeatability, new in each dwell, p_s the squareness, the same at all temperatures.
If the file has no statistics of the dwells, v and p_r cannot be separated, and v is their sum.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from triaxcal.model.types import FloatArray
from triaxcal.uncertainty.propagation import Propagation

_PAIRS = ((4, 5), (1, 3), (0, 2))
"""TP5 and TP6 along x, TP2 and TP4 along y, TP1 and TP3 along z."""


@dataclass(frozen=True)
class Scatter:
    """Noise and placement, found or recorded.

    Attributes
    ----------
    variance_v2 : array, shape (6 G, 3)
        Of the dwells' means.
    recorded : bool
        Whether it is the dwells' own statistics.
    noise_dof : float
    repeatability_rad, squareness_rad : float
        Standard deviations of the tilts about each axis; zero where noise explains the residuals.
    repeatability_dof, squareness_dof : float
    resolution_rad : float
        Standard error of a squareness of zero: a smaller one is within the noise.
    pattern_g : array, shape (3, 3)
        What stays at all temperatures: half-sum of the pair along x, y, z (row) about the mean of
        the three, in the force's x, y, z. The tilter's own, whatever the unit's constants are.
    """

    variance_v2: FloatArray
    recorded: bool
    noise_dof: float
    repeatability_rad: float
    repeatability_dof: float
    squareness_rad: float
    squareness_dof: float
    resolution_rad: float
    pattern_g: FloatArray


def scatter(p: Propagation) -> Scatter:
    """Noise of the readings, and placement from their residuals."""
    about = _half_sums(p)
    pattern = about.mean(axis=0)
    within, mean = float(np.sum((about - pattern) ** 2)), float(np.sum(pattern**2))
    G, g2 = p.groups, p.unit.gravity_g**2
    gain = np.sqrt(np.mean(np.sum(p.dwell_gain**2, axis=2), axis=0))
    within_dof = 6.0 * (G - 1)
    recorded = p.data.readings.variance_v2
    if recorded is not None:
        variance = recorded.reshape(-1, 3)
        v = float(np.mean(np.sum(p.inverse.mean(axis=0) ** 2 * variance.mean(axis=0), axis=1)))
        noise_dof = p.data.readings.variance_dof
        p_r = max(0.0, 1.5 * (within / (3.0 * (G - 1)) - v)) if G > 1 else 0.0
    else:
        # One temperature cannot separate noise from placement: each has the whole scatter.
        v = within / (3.0 * (G - 1)) if G > 1 else mean / 3.0
        variance = np.broadcast_to(v * gain**2, p.forces_g.shape)
        noise_dof = within_dof or 6.0
        p_r = 0.0
    random = v / G + p_r / (1.5 * G) if G > 1 or recorded is not None else 0.0
    found = 1.5 * (mean / 3.0 - random)
    # S_m has 6 degrees of freedom: its relative standard error is sqrt(2 / 6).
    resolution = 1.5 * random * math.sqrt(2.0 / 6.0)
    return Scatter(
        variance_v2=variance,
        recorded=recorded is not None,
        noise_dof=noise_dof,
        repeatability_rad=math.sqrt(p_r / g2),
        repeatability_dof=within_dof,
        squareness_rad=math.sqrt(max(found, 0.0) / g2),
        squareness_dof=6.0,
        resolution_rad=math.sqrt(resolution / g2),
        pattern_g=pattern,
    )


def _half_sums(p: Propagation) -> FloatArray:
    """Half-sums over opposite positions about the mean of the three, (G, pair, axis), in g."""
    temps = p.data.readings.temps_degc
    K = p.calibration.thermal.constants_at(temps)[:, :9].reshape(-1, 3, 3)
    force = np.einsum("gij,gdj->gdi", np.linalg.inv(K), p.shifted)
    half_sums = np.stack([(force[:, a] + force[:, b]) / 2.0 for a, b in _PAIRS], axis=1)
    result: FloatArray = half_sums - half_sums.mean(axis=1, keepdims=True)
    return result
