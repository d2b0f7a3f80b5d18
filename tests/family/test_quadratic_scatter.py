"""Quadratic terms from |a| = g alone: the stated uncertainty against the scatter of many seeds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from family_cases import U0, K, directions, write_unit

from triaxcal.fitting.recorded.scalar import VISIBLE
from triaxcal.fitting.route import calibrate_recording
from triaxcal.model.metrological import force_from_voltage
from triaxcal.model.terms import products
from triaxcal.uncertainty.evaluate import uncertainty
from triaxcal.uncertainty.orientation import DIRECTIONS, force_variance
from triaxcal.unit.description import read_unit

SINGLE = 'rows = "poses"\nacceleration = ["ax", "ay", "az"]\nacceleration_unit = "m/s^2"'


@pytest.mark.slow
def test_the_force_scatters_as_stated(tmp_path: Path) -> None:
    """24 poses, 16 unknowns: |a| in 146 orientations over 120 seeds.

    Each ratio of variances is of 120 draws, 0.13 of it. Components turn with the frame, which
    |a| does not show.
    """
    draws, poses = 120, directions(24, seed=3)
    Q = 1e-4 * np.tensordot(np.arange(1.0, 1.0 + len(VISIBLE)), VISIBLE, axes=1)
    clean = (poses + products(poses) @ Q.T) @ K.T + U0
    exact = (DIRECTIONS + products(DIRECTIONS) @ Q.T) @ K.T + U0
    errors, stated = [], []
    for seed in range(draws):
        noise = 1e-4 * np.random.default_rng(seed).standard_normal(clean.shape)
        folder = tmp_path / str(seed) / "U"
        more = '[fit]\nterms = "quadratic"\n'
        write_unit(folder, clean + noise, SINGLE, header="ax,ay,az", more=more)
        unit = read_unit(folder)
        assert unit.recording is not None
        unit, measurements, calibration = calibrate_recording(unit, unit.recording, folder)
        u = uncertainty(unit, measurements, calibration, None, np.array([20.0]))
        force = next(s for s in u.sources if s.key == "poses").force
        assert force is not None
        assert force.shape == (1, 30, 30)
        stated.append(force_variance(force, DIRECTIONS)[0, :, 3])
        constants = calibration.thermal.constants_at(20.0)
        seen = calibration.terms.force_g(force_from_voltage(constants, exact))
        errors.append(np.linalg.norm(seen, axis=1) - 1.0)
    ratio = np.mean(np.square(errors), axis=0) / np.mean(stated, axis=0)
    assert np.abs(ratio - 1.0).max() < 5.0 * np.sqrt(2.0 / draws), (ratio.min(), ratio.max())
