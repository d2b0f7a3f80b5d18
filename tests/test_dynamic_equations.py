"""Rows of every block against differences of the exact equations, on exact physics."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from dynamic_cases import held, short_motion
from triaxcal.dynamic.blocks.attitude import matrix_of, quaternion_of, rotation_of, running_product
from triaxcal.dynamic.blocks.base import BASE
from triaxcal.dynamic.blocks.registry import EXTENSIONS
from triaxcal.dynamic.channels import Moments, extra_rows, table_axes
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.preintegrate import BlockEquations, equations
from triaxcal.dynamic.recording import INCREMENT, INSTANT, ImuRecording, Turntable
from triaxcal.dynamic.window import About, Frame, Window
from triaxcal.simulation.imu import simulate_imu
from triaxcal.simulation.imu_grades import GRADES, draw_truth
from triaxcal.simulation.imu_motion import PRECISE_TABLE
from triaxcal.simulation.imu_temperature import WARMING
from triaxcal.simulation.imu_truth import ImuNoise, ImuTruth

RATE_HZ, BLOCK = 100.0, 20
ALL = tuple(dict.fromkeys(b for e in EXTENSIONS for b in e.blocks))
LAYOUT = Layout((*BASE, *ALL))
EARTH = 7.292115e-5 * np.array([0.0, np.cos(np.radians(50)), np.sin(np.radians(50))])


@cache
def recording(convention: str) -> ImuRecording:
    """Base errors absent, so that the zero of every state is the truth."""
    truth = replace(ImuTruth(), rate_convention=convention, force_convention=convention)
    truth = replace(truth, second=draw_second(), noise=ImuNoise())
    motion = replace(short_motion(1), temperature=WARMING, table=PRECISE_TABLE)
    return held(simulate_imu(truth, motion, RATE_HZ, 1))


def draw_second() -> object:
    second = draw_truth(GRADES["aviation"], 1, ("second-triad",)).second
    assert second is not None
    zero = (0.0, 0.0, 0.0)
    return replace(
        second, bias_mm_per_s2=zero, scale_ppm=zero, misalignment_arcsec=zero * 2, delay_ms=0.0
    )


def made(convention: str, p: np.ndarray) -> BlockEquations:
    found = recording(convention)
    samples = found.all()
    frame = Frame(LAYOUT, convention, convention, found.gravity_m_per_s2, BLOCK, 1 / RATE_HZ, 20.0)
    C = table_axes(short_motion(1).turntable()).T  # at rest, at angle zero
    blocks = 120  # 24 s: rest, a whole turn at 60 deg/s, rest, and the start of another
    return equations(Window(samples, 0, blocks, About(C, p, EARTH), frame))


def test_every_block_together_makes_a_hundred_and_six_states() -> None:
    """85 of P2, and 6, 3, 9 and 3 of nonlinearity and asymmetry of both triads."""
    assert 3 + len(LAYOUT) == 106
    assert 3 + len(Layout(BASE)) == 24


@pytest.mark.parametrize("convention", [INSTANT, INCREMENT])
def test_rows_are_derivatives(convention: str) -> None:
    """y and the attitude at p against both at 0: first order must be what G and F say.

    The steps are so small that second order is a millionth. Rows are taken at nodes: a turn of
    2.4 deg between them leaves 2.4^2/24 deg^2 = 7e-5 of a term that turns once, four times that of
    one that turns twice, and the mean over a block loses as much again: 1e-3 holds.
    """
    at_zero = made(convention, np.zeros(len(LAYOUT)))
    gravity = recording(convention).gravity_m_per_s2
    H = np.array([[0, -gravity, 0], [gravity, 0, 0], [0, 0, 0]])
    blocks = len(at_zero.duration_s)
    for k, state in enumerate(LAYOUT.states):
        p = np.zeros(len(LAYOUT))
        p[k] = 1e-3 * min(state.prior_sd, 100.0) * state.per_unit
        at_p = made(convention, p)
        # The truth is 0: about p the errors that are left are -p.
        beta, expected, expected2 = np.zeros(3), np.zeros((blocks, 3)), np.zeros((blocks, 3))
        share = 0.5 if convention == INCREMENT else 0.5 * (1 + 1 / BLOCK)
        assert at_p.y2 is not None
        assert at_p.F2 is not None
        assert at_zero.y2 is not None
        for b in range(blocks):
            after = at_p.Phi[b] @ beta - at_p.G[b] @ -p
            tilt = H @ ((1 - share) * beta + share * after + at_p.G_lag[b] @ -p)
            expected[b] = tilt + at_p.F[b] @ -p
            expected2[b] = tilt + at_p.F2[b] @ -p
            beta = after
        for change, predicted in (
            (at_p.y - at_zero.y, expected),
            (at_p.y2 - at_zero.y2, expected2),
        ):
            size = max(np.abs(predicted).max(), np.abs(change).max())
            assert np.abs(change - predicted).max() <= 1e-3 * size + 1e-12, state.name


def test_exact_physics_leaves_nothing() -> None:
    """Without errors y is zero but for the integration: below 1e-6 m/s^2 at 100 Hz."""
    for convention in (INSTANT, INCREMENT):
        y = made(convention, np.zeros(len(LAYOUT))).y
        assert np.abs(y).max() < 1e-6


def test_table_rows_are_derivatives() -> None:
    """y = psi - psi_0 - L' beta by turning the instrument exactly."""
    rng = np.random.default_rng(3)
    layout = Layout((*BASE, *EXTENSIONS["mount-elasticity"].blocks))
    turntable = Turntable(0.7, 0.02, ())
    noise = DataSheet(0.1, 10.0, table_sd_arcsec=1.0)
    angle = rng.standard_normal(4)
    p = np.zeros(len(layout))

    def rows(C: np.ndarray, p: np.ndarray) -> np.ndarray:
        yes = np.ones(4, dtype=bool)
        at = Moments(C, angle, np.zeros(4), yes, ~yes, 1, 9.8)
        ((made, _),) = extra_rows(at, layout, p, noise, (turntable, np.eye(3)))
        return made

    # psi of some degrees brings the instrument's axes to the plate's: y vanishes there.
    plate = rotation_of(np.stack([-angle, 0 * angle, 0 * angle], axis=1)) @ table_axes(turntable)
    theta = np.array([2e-3, -3e-3, 1e-3])
    attitude = rotation_of(-theta) @ plate
    p[layout.place("table-angles")] = theta
    found = rows(np.swapaxes(attitude, 1, 2), p)
    assert np.abs(found[:, :, -1]).max() < 1e-9 * np.abs(found[:, :, 3:6]).max()
    beta = np.array([1e-6, -2e-6, 3e-6])
    # L = L' (1 + hat(beta)) with hat(beta) = -[beta]: L'^T = exp(-[beta]) L^T.
    tilted = rotation_of(-beta) @ np.swapaxes(attitude, 1, 2)
    made = rows(tilted, p)
    predicted = made[:, :, 3:6] @ beta
    assert np.abs(made[:, :, -1] - predicted).max() < 1e-4 * np.abs(predicted).max()


def test_running_product_is_the_product_one_by_one() -> None:
    steps = quaternion_of(0.1 * np.random.default_rng(1).standard_normal((37, 3)))
    product = np.eye(3)
    for step, found in zip(matrix_of(steps), matrix_of(running_product(steps)), strict=True):
        product = product @ step
        np.testing.assert_allclose(found, product, rtol=0, atol=1e-13)
