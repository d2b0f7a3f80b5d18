"""Equations of blocks divided by the standard deviations of their noise."""

from __future__ import annotations

import numpy as np

from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.preintegrate import BlockEquations
from triaxcal.dynamic.window import Frame
from triaxcal.model.types import FloatArray, IntArray


def whitened(made: BlockEquations, use: IntArray, frame: Frame, noise: DataSheet) -> FloatArray:
    """Rows for `RootFilter.run`: every equation divided by its noise's standard deviation."""
    blocks, n = len(made.duration_s), made.G.shape[2]
    g, density = frame.gravity, noise.rate_density
    T = float(made.duration_s.mean())
    height = 6 if made.y2 is None else 9
    rows = np.zeros((blocks, height, 7 + n))
    drift = 1 / np.sqrt(density**2 * made.duration_s + made.turn_variance)[:, None, None]
    rows[:, :3, :3] = made.Phi * drift
    rows[:, :3, 3:6] = -np.eye(3) * drift
    rows[:, :3, 6:-1] = -made.G * drift
    H = np.array([[0.0, -g, 0.0], [g, 0.0, 0.0], [0.0, 0.0, 0.0]])
    place = 0.5 if frame.force_is_increment else 0.5 * (1 + 1 / frame.block)
    # Lost samples turn the unit at some time in the block: at its ends this is farthest from what
    # both ends say of the mean.
    within = (g * density) ** 2 * T / 12 + g**2 * made.turn_variance / 4
    level = np.stack([within, within, np.zeros(blocks)], axis=1)
    counted = max(1.0, frame.block * frame.force_part)
    channels = [(3, made.y, made.F, False)]
    if made.y2 is not None and made.F2 is not None:
        channels.append((6, made.y2, made.F2, True))
    for top, y, F, second in channels:
        variance = noise.mean_force_variance(T, counted, frame.force_convention, second)
        weight = use[:, None] / np.sqrt(variance + made.force_variance[:, None] + level)
        part = rows[:, top : top + 3]
        part[:, :, :3] = (1 - place) * H * weight[:, :, None]
        part[:, :, 3:6] = place * H * weight[:, :, None]
        part[:, :, 6:-1] = (F + H @ made.G_lag) * weight[:, :, None]
        part[:, :, -1] = y * weight
    return rows
