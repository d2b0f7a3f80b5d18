"""Measurements by the turntable: its angle at rest, P2 (17)-(19), its axis while turning, (15).

Both need the heading, so they begin with the second pass. The attitude of the plate is

    L'' = mounting * turn about the table's first axis * table axes

and the instrument is turned against it by a small psi (rotation vector on its own axes, reference
value psi_0): L = exp(hat(psi)) L''. With L = L' (1 + hat(beta)), the vector of the small rotation

    L' L''^T exp(-hat(psi_0)) = 1 + hat(y)    is    y = psi - psi_0 - L' beta,

which is (18), (19); exp(hat(psi)) is exp(hat(d f/g)) exp(hat(theta)). The table's axis is fixed in
the instrument, e + kappa_3 e_2 - kappa_2 e_3 with e, e_2, e_3 the nominal instrument vectors along
the table's axes, and on the Earth, n = t_1, so

    t (L'^T e - n) = -t (beta x n) - t L'^T (kappa_3 e_2 - kappa_2 e_3),    t = t_2, t_3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from triaxcal.dynamic.blocks.attitude import rotation_of
from triaxcal.dynamic.blocks.base import ARCSEC
from triaxcal.dynamic.blocks.block import Signals
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.recording import Turntable
from triaxcal.model.types import BoolArray, FloatArray

TABLE, AXIS = "table-angles", "rotation-axis"
STEADY_SD = 3.0
"""A table whose angle drifts within a block by more than so many deviations does not rest."""


@dataclass(frozen=True)
class Moments:
    """Ends of blocks of samples.

    Attributes
    ----------
    C : array, shape (b, 3, 3)
        L'^T.
    table_angle_rad : array, shape (b,), or None
        Mean over the block.
    turned_rad : array, shape (b,)
        How far the unit turned in the block.
    still, turning : arrays of bool, shape (b,)
        Whether it stood, or turned on the table; neither while it is handled.
    samples : int
        Of each block.
    gravity : float
    """

    C: FloatArray
    table_angle_rad: FloatArray | None
    turned_rad: FloatArray
    still: BoolArray
    turning: BoolArray
    samples: int
    gravity: float


def table_axes(table: Turntable) -> FloatArray:
    """Rows are the table's axes in east, north, up, shape (3, 3)."""
    azimuth, elevation = table.azimuth_rad, table.elevation_rad
    level = math.cos(elevation)
    along = np.array([math.sin(azimuth) * level, math.cos(azimuth) * level, math.sin(elevation)])
    up = np.array([0.0, 0.0, 1.0])
    third = up - (up @ along) * along
    third /= np.linalg.norm(third)
    return np.array([along, np.cross(third, along), third])


def steady(angle_rad: FloatArray, sd_rad: float) -> BoolArray:
    """Blocks of readings (b, samples) in which the table's angle stays, shape (b,).

    For the gyros a table is at rest that turns slower than they resolve at the start: in the last
    tenths of a second before a stop it may turn by 90", and the reading's mean over the block is
    not its end. The two halves of a block differ by no more than their noise where the table
    rests, and a block beside one that moves is not used: it may hold what the test cannot see.
    """
    blocks, samples = angle_rad.shape
    halves = angle_rad[:, : samples // 2 * 2].reshape(blocks, 2, -1).mean(axis=2)
    drift = np.abs(halves[:, 1] - halves[:, 0])
    rests = np.pad(drift < STEADY_SD * 2 * sd_rad / math.sqrt(samples), 1, mode="edge")
    both_sides: BoolArray = rests[:-2] & rests[1:-1] & rests[2:]
    return both_sides


Table = tuple[Turntable, FloatArray]
"""The turntable, and the matrix of the present mounting."""
Rows = tuple[FloatArray, BoolArray]
"""Whitened rows (b, 3 or 2, 7 + n) of a channel, and the blocks that have them."""


def extra_rows(
    at: Moments, layout: Layout, p: FloatArray, noise: DataSheet, table: Table
) -> list[Rows]:
    """Rows of each channel that is on."""
    made = []
    if TABLE in layout and at.table_angle_rad is not None:
        made.append(_table_rows(at, layout, p, noise, table))
    if AXIS in layout:
        made.append(_axis_rows(at, layout, p, noise, table))
    return made


def _table_rows(at: Moments, layout: Layout, p: FloatArray, noise: DataSheet, table: Table) -> Rows:
    assert at.table_angle_rad is not None
    assert noise.table_sd_arcsec is not None
    turntable, mounting = table
    angle = np.zeros((len(at.C), 3))
    angle[:, 0] = -at.table_angle_rad
    nominal = mounting @ rotation_of(angle) @ table_axes(turntable)
    load = at.C[:, 2, :]
    zero = np.zeros_like(load)
    signals = Signals(zero, zero, load * at.gravity, zero[:, 0], at.gravity)
    own = layout.rows("table", signals)
    # The mounts turn the unit after it was put on the plate: theta first, then d f/g.
    theta = layout.place(TABLE)
    placed = own[:, :, theta] @ p[theta]
    bent = own @ p - placed
    inward = np.swapaxes(at.C, 1, 2)
    back = rotation_of(placed) @ rotation_of(bent)
    y = _vector(inward @ np.swapaxes(nominal, 1, 2) @ back)
    rows = _rows(len(y), 3, len(layout))
    rows[:, :, 3:6] = -inward
    rows[:, :, 6:-1] = own
    rows[:, :, -1] = y
    sd = noise.table_sd_arcsec * ARCSEC / math.sqrt(at.samples)
    return rows * (at.still / sd)[:, None, None], at.still


def _axis_rows(at: Moments, layout: Layout, p: FloatArray, noise: DataSheet, table: Table) -> Rows:
    assert noise.axis_wobble_arcsec is not None
    turntable, mounting = table
    first, second, third = table_axes(turntable)
    across = np.array([second, third])
    place = layout.place(AXIS)
    on_earth = at.C @ mounting  # columns: the instrument's nominal e, e_2, e_3
    rows = _rows(len(at.C), 2, len(layout))
    rows[:, :, 3:6] = -np.cross(first, across)
    rows[:, :, 6:-1][:, :, place] = np.stack(
        [on_earth[:, :, 2] @ across.T, -on_earth[:, :, 1] @ across.T], axis=-1
    )
    rows[:, :, -1] = (on_earth[:, :, 0] - first) @ across.T - rows[:, :, 6:-1] @ p
    # A wobble repeats with the turn: a whole turn, and not a block, is one measurement of it.
    turns = np.maximum(at.turned_rad, 1e-9) / (2 * math.pi)
    weight = at.turning * np.sqrt(turns) / (noise.axis_wobble_arcsec * ARCSEC)
    return rows * weight[:, None, None], at.turning


def _rows(blocks: int, height: int, n: int) -> FloatArray:
    return np.zeros((blocks, height, 7 + n))


def _vector(rotation: FloatArray) -> FloatArray:
    """Vector x (b, 3) of a small rotation 1 + hat(x), hat(x) = -[x], by its skew part."""
    return np.stack(
        [
            (rotation[:, 1, 2] - rotation[:, 2, 1]) / 2,
            (rotation[:, 2, 0] - rotation[:, 0, 2]) / 2,
            (rotation[:, 0, 1] - rotation[:, 1, 0]) / 2,
        ],
        axis=-1,
    )
