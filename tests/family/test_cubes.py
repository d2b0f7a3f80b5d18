"""Cubes of the own accelerations, which the C does not compute: found, said, in the budget."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from family_cases import U0, K, directions, write_unit
from test_recordings import calibrated
from test_table_terms import AIR, GRID, HEADER, NOISE, T0, Sensor

from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.core.noise import NoisePrior
from triaxcal.fitting.core.outliers import CHANCE
from triaxcal.fitting.recorded.cubes import scalar_cubes
from triaxcal.fitting.recorded.magnitude import fit_with_prior
from triaxcal.fitting.recorded.prior import FULL, Known
from triaxcal.fitting.recorded.scalar import scalar_data
from triaxcal.fitting.recorded.solution import ScalarFit
from triaxcal.model.orientation import AIRCRAFT, gravity_direction
from triaxcal.model.terms import products
from triaxcal.model.types import FloatArray
from triaxcal.unit.priors import Priors

ROWS = 'rows = "poses"\nacceleration = ["ax", "ay", "az"]\nacceleration_unit = "m/s^2"'
SD_G = 5e-6
CUBES = np.array([1e-4, -1.5e-4, 2e-4])


def cubes_said(calibration: Calibration) -> str:
    """The finding about cubes, or nothing."""
    assert calibration.recording is not None
    return next((f for f in calibration.recording.findings if "the cube of" in f), "")


def values(said: str) -> FloatArray:
    """K3 and sd of x, y, z in a finding, micro-g/g^3."""
    parts = said.split("K3 ")[1].split(" micro-g", maxsplit=1)[0].split(", ")
    return np.array([[float(n) for n in part[2:].split(" ± ")] for part in parts])


def poses(folder: Path, k3: FloatArray, seed: int, count: int = 60) -> Calibration:
    """|a| = g alone: poses with cubes of the outputs' own accelerations."""
    force = directions(count, seed)
    noise = SD_G * np.random.default_rng(seed).standard_normal(force.shape)
    rows = (force + k3 * force**3 + noise) @ K.T + U0
    return calibrated(write_unit(folder, rows, ROWS, header="ax,ay,az"))


def test_poses_off_the_axes_show_cubes(tmp_path: Path) -> None:
    """Three at once within four of their standard deviations, six times."""
    apart = []
    for seed in range(2):
        said = cubes_said(poses(tmp_path / str(seed), CUBES, seed))
        found = values(said)
        # A scale and two axes that are not square cost about 2 / sqrt(60) of the noise and more.
        assert found[:, 1].max() < 4 * SD_G * 1e6
        apart.append((found[:, 0] - CUBES * 1e6) / found[:, 1])
    assert np.abs(apart).max() < 4.0
    assert "leaves up to 8" in said or "leaves up to 7" in said  # 0.4 of 2e-4 is 80 micro-g


def test_no_cube_is_said_of_noise(tmp_path: Path) -> None:
    """A chance of 1e-3 in each of 8 units."""
    said = [cubes_said(poses(tmp_path / str(n), np.zeros(3), n, 30)) for n in range(8)]
    assert not any(said)


def fit_of_all_terms(count: int, seed: int, size: float, k3: float = 0.0) -> ScalarFit:
    """A unit whose constants are `size` of the default priors, with 1 mg of noise."""
    random, p = np.random.default_rng(seed), Priors()
    cross = np.triu(p.cross_term_rad * random.standard_normal((3, 3)), 1)
    scales = p.scale_factor * random.standard_normal(3) + p.mean_scale * random.standard_normal()
    Q = p.product_g_per_g2 * random.standard_normal((3, 6))
    Q[range(3), range(3)] = p.own_square_g_per_g2 * random.standard_normal(3)
    force = directions(count, seed)
    linear = force
    for _ in range(15):
        linear = force - size * products(linear) @ Q.T
    matrix = np.eye(3) + size * (np.diag(scales) + cross + cross.T)
    readings = (linear + k3 * linear**3) @ matrix.T
    readings += size * p.bias_g * random.standard_normal(3)
    readings += 1e-3 * random.standard_normal(force.shape)
    data = scalar_data(readings, np.ones((count, 1)), np.ones(count), 1.0)
    data = replace(data, count=np.ones(count))
    return fit_with_prior(FULL, data, 1, Known(p, 1.0, np.zeros(3)))


@pytest.mark.parametrize("size", [1.0, 0.0])
def test_few_poses_of_sound_units_show_no_cubes(size: float) -> None:
    """Priors tell most constants of 18 to 20 poses, be they as large as these say, or 0."""
    found = [scalar_cubes(fit_of_all_terms(18 + n % 3, n, size), NoisePrior()) for n in range(300)]
    # CHANCE of 300 is 0.3: more than 4 are once in 1e5 runs.
    assert sum(c is not None and c.chance < CHANCE for c in found) <= 4


def test_a_large_cube_is_found_in_few_poses_with_priors() -> None:
    """Of constants as large as the priors say, by 30 poses: 6e-3 is six times the noise."""
    found = [scalar_cubes(fit_of_all_terms(30, n, 0.3, 6e-3), NoisePrior()) for n in range(20)]
    # 107 of 150 others were found.
    assert sum(c is not None and c.chance < CHANCE for c in found) >= 8


def test_the_budget_carries_a_cube_that_the_c_leaves_out(tmp_path: Path) -> None:
    """What is held out shows it: its part of the model's error is what it does to |a|."""
    small = poses(tmp_path / "none", np.zeros(3), 0).recording
    large = poses(tmp_path / "some", CUBES, 0).recording
    assert small is not None
    assert large is not None
    assert large.held_out_g is not None
    assert small.held_out_g is not None
    # theory.md: 7.6 micro-g rms of |a| for one axis of 1e-4, so 20 for these three.
    assert large.held_out_g > 1e-5 > 1.6 * small.held_out_g


@pytest.mark.parametrize("bent", [0.0, 3e-4])
def test_a_table_shows_them_axis_by_axis(tmp_path: Path, bent: float) -> None:
    """P0's grid has z near 1 g alone, where a scale takes up its cube; x and y within 30 deg."""
    sensor = Sensor(2)
    force = gravity_direction(AIRCRAFT, GRID)
    angles, cube = np.tile(GRID, (2, 1)), np.tile(force**3, (2, 1)) * [bent, -bent, 0.0]
    readings = sensor.read(angles, np.full(50, 25.0)) + cube @ sensor.K.T
    rows = np.column_stack([np.degrees(angles), readings, np.full(50, 25.0)])
    said = cubes_said(calibrated(write_unit(tmp_path, rows, AIR, header=HEADER, more=T0)))
    assert bool(said) == bool(bent)
    if said:
        found = values(said)
        assert np.abs(found[:, 0] - [300.0, -300.0]).max() < 4 * found[:, 1].max()
        assert found[:, 1].max() < 40 * NOISE * 1e6
