"""The model of both triads undoes exactly what P2's errors do, D and temperature included."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from test_dynamic_calibrate import mems_result
from triaxcal.dynamic.blocks.base import BASE
from triaxcal.dynamic.blocks.registry import EXTENSIONS
from triaxcal.dynamic.imumodel import imu_model
from triaxcal.dynamic.layout import Layout
from triaxcal.model.methods.imu import ImuCompensation, compensate_imu

G_STANDARD = 9.80665


def test_compensated_readings_are_the_true_ones() -> None:
    names = ("g-drift", "accelerometer-thermal", "gyro-thermal")
    layout = Layout((*BASE, *(b for n in names for b in EXTENSIONS[n].blocks)))
    rng = np.random.default_rng(7)
    p = 1e-2 * rng.standard_normal(len(layout)) * np.minimum(layout.prior_sd, 1.0)
    base = mems_result()
    result = replace(base, layout=layout, p=p)
    model = imu_model(result, (-40.0, 85.0))
    device = compensate_imu(model, "inverse", (-40.0, 85.0), (20.0, 10.0), (1e-6, 1e-6))
    assert isinstance(device, ImuCompensation)
    gravity = result.frame.gravity

    def part(name: str) -> np.ndarray:
        return p[layout.place(name)]

    for temp in (-40.0, 20.0, 70.0):
        force, rate = 9.8 * rng.standard_normal((50, 3)), rng.standard_normal((50, 3))
        dt = temp - 20.0
        gamma = np.zeros((3, 3))
        gamma[np.tril_indices(3)] = part("accelerometer-matrix")
        gamma += dt * np.diag(part("accelerometer-thermal")[3:])
        theta = part("gyro-matrix").reshape(3, 3) + dt * np.diag(part("gyro-thermal")[3:])
        read_f = force + force @ gamma.T
        read_f += part("accelerometer-bias") + dt * part("accelerometer-thermal")[:3]
        read_w = rate + rate @ theta.T + part("gyro-bias") + dt * part("gyro-thermal")[:3]
        read_w += force / gravity @ part("g-drift").reshape(3, 3).T
        found_g, found_w = device(read_f / G_STANDARD, read_w, temp)
        # The inverse is exact; G is taken at the reference temperature: dT K_Theta D is left out.
        np.testing.assert_allclose(found_g * G_STANDARD, force, rtol=0, atol=1e-12 * 40)
        drift = np.abs(part("g-drift")).max() * 3 * 4
        slope = np.abs(part("gyro-thermal")[3:]).max() * abs(dt)
        assert np.abs(found_w - rate).max() < 2 * drift * slope + 1e-12
