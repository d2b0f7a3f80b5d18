"""Known orientations, P0: the 25-position grid of section 7, the forms of (12) to (38)."""

from __future__ import annotations

import normal_equations
import numpy as np
import pytest

from triaxcal.fitting.table.harmonics import full_turn, plane_tilt
from triaxcal.fitting.table.oriented import (
    TRACELESS,
    SerialGrid,
    inverse_linear,
    inverse_quadratic,
    table_error_g,
)
from triaxcal.model.orientation import (
    AIRCRAFT,
    INCLINOMETER,
    angle_slopes,
    angles_from_force,
    direction_cosines,
    gravity_direction,
)
from triaxcal.model.terms import products
from triaxcal.model.types import FloatArray

# P0, table 2 at -25 degC: bias, then D row by row; the units are those of the AK-15's output.
D = np.array(
    [
        [12.848906, 0.010372, 0.005943],
        [-0.001534, 12.811360, 0.014688],
        [-0.001269, -0.006453, 12.845083],
    ]
)
D0 = np.array([-0.166049, 0.047870, 0.738719])
ARCSEC = np.pi / 180.0 / 3600.0
KINDS = (AIRCRAFT, INCLINOMETER)


def solve_serial(unknowns, readings, *, shortcut: bool):
    """Forces (n, 3) of readings (n, 3) by P0 (36), (37), or by the shortcut (38).

    The shortcut takes D^T for D^-1: right to first order where D is near a rotation, so where
    scale factors are near 1 and the readings in g.
    """
    d0, D = unknowns[:, 0], unknowns[:, 1:4]
    inverse = D.T if shortcut else np.linalg.inv(D)
    force = (readings - d0) @ inverse.T
    if unknowns.shape[1] > 4:
        D2 = unknowns[:, 4:] @ TRACELESS
        force = (readings - d0 - products(force) @ D2.T) @ inverse.T
    return force


def grid() -> FloatArray:
    """Table 1: pitch and roll each from -30 to 30 deg by 15 deg, shape (25, 2)."""
    steps = np.radians(np.arange(-30.0, 31.0, 15.0))
    return np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(25, 2)


def measured(angles: FloatArray, seed: int, quadratic: FloatArray | None = None) -> FloatArray:
    """Readings at the table's true angles, 4 arcsec off the nominal ones each."""
    random = np.random.default_rng(seed)
    force = gravity_direction(AIRCRAFT, angles + 4.0 * ARCSEC * random.standard_normal((25, 2)))
    readings = force @ D.T + D0
    return readings if quadratic is None else readings + products(force) @ quadratic.T


@pytest.mark.parametrize("kind", KINDS)
def test_direction_cosines_are_a_rotation_and_their_last_column_is_gravity(kind: str) -> None:
    angles = np.random.default_rng(1).uniform(-3.0, 3.0, (200, 3))
    A = direction_cosines(kind, angles)
    # Products of nine sines and cosines: some tens of roundings of 1e-16.
    assert np.abs(A @ np.swapaxes(A, 1, 2) - np.eye(3)).max() < 1e-14
    assert np.abs(np.linalg.det(A) - 1.0).max() < 1e-14
    assert np.abs(A[:, :, 2] - gravity_direction(kind, angles)).max() < 1e-15


def test_the_printed_3_is_not_orthogonal() -> None:
    """a13 = +sin mu beside the other printed entries: rows X and Z are not perpendicular."""
    psi, mu, nu = 0.3, 0.4, 0.5
    x = [np.cos(psi) * np.cos(mu), np.sin(psi) * np.cos(mu), np.sin(mu)]
    z = [
        np.sin(psi) * np.sin(nu) + np.cos(psi) * np.sin(mu) * np.cos(nu),
        np.cos(psi) * np.sin(nu) + np.sin(psi) * np.sin(mu) * np.cos(nu),
        np.cos(mu) * np.cos(nu),
    ]
    assert abs(np.dot(x, z)) > 0.1


@pytest.mark.parametrize("kind", KINDS)
def test_angles_come_back_from_the_force(kind: str) -> None:
    random = np.random.default_rng(2)
    low, high = ((-1.5, 1.5), (0.05, 3.09))[kind == INCLINOMETER]
    angles = np.stack([random.uniform(low, high, 500), random.uniform(-3.1, 3.1, 500)], axis=1)
    back = angles_from_force(kind, 3.7 * gravity_direction(kind, angles))
    # 1e-16 of the force over the smallest lever, sin 0.05 or cos 1.5.
    assert np.abs(back - angles).max() < 1e-13


@pytest.mark.parametrize("kind", KINDS)
def test_slopes_are_those_of_the_direction(kind: str) -> None:
    angles = np.random.default_rng(3).uniform(-1.2, 1.2, (50, 2))
    h = 1e-6
    for k in range(2):
        step = h * np.eye(2)[k]
        up, down = gravity_direction(kind, angles + step), gravity_direction(kind, angles - step)
        # Third derivatives below 1: h^2 / 6, and rounding 1e-16 / h.
        assert np.abs((up - down) / (2 * h) - angle_slopes(kind, angles)[:, :, k]).max() < 1e-9


def test_table_2_is_found_again_within_the_tables_error_budget() -> None:
    """Each coefficient within four of its standard errors, which the budget of 4 arcsec gives."""
    angles = grid()
    force = gravity_direction(AIRCRAFT, angles)
    serial = SerialGrid.of(force)
    # Angle errors turned into readings: D times the error of the force.
    slopes = angle_slopes(AIRCRAFT, angles) * 4.0 * ARCSEC
    in_readings = np.einsum("ij,njk->nik", D, slopes)
    sd = np.sqrt(np.einsum("pn,nik->ip", serial.operator**2, in_readings**2))
    truth = np.concatenate([D0[:, None], D], axis=1)
    errors = np.array([serial.unknowns(measured(angles, seed)) - truth for seed in range(40)])
    assert np.abs(errors / sd).max() < 4.5  # 480 values: beyond 4.5 once in 300 such tests
    assert 0.85 < np.sqrt(np.mean((errors / sd) ** 2)) < 1.15  # and the budget is not idle
    # The budget as section 5 has it, beside sqrt(eps) of the fit: of one size.
    budget = np.sqrt(np.mean(table_error_g(AIRCRAFT, angles, 4.0 * ARCSEC, 0.0, 1.0) ** 2))
    fit = serial.fit(measured(angles, 0))
    root_eps = np.sqrt(np.mean((fit.force_g(measured(angles, 0)) - force) ** 2))
    assert 0.5 * budget < root_eps < 1.2 * budget


def test_serial_form_is_the_direct_solve() -> None:
    angles = grid()
    force, readings = gravity_direction(AIRCRAFT, angles), measured(angles, 7)
    design = np.concatenate([np.ones((25, 1)), force], axis=1)
    direct = np.linalg.lstsq(design, readings, rcond=None)[0].T
    # Conditioned like 30: 1e-16 * 30 of readings of 13.
    assert np.abs(SerialGrid.of(force).unknowns(readings) - direct).max() < 1e-12


def test_the_normal_equations_of_15_17_20_are_the_same_solution() -> None:
    angles = grid()
    force = gravity_direction(AIRCRAFT, angles)
    readings = measured(angles, 5) / 12.8  # (17) is meant for readings in g
    fit = inverse_linear(readings, force)
    N = np.linalg.inv(fit.K)
    expected = np.concatenate([-(N @ fit.U0)[:, None], N], axis=1)
    for form in (normal_equations.plain, normal_equations.from_identity, normal_equations.centred):
        # The condition number squared, about 1e3, times 1e-16 and the size of the sums.
        assert np.abs(form(readings, force) - expected).max() < 1e-11


def test_two_stages_reach_less_than_all_at_once() -> None:
    """(25) leaves what the linear part has taken: its residual is between (12) and (13)."""
    angles = grid()
    force = gravity_direction(AIRCRAFT, angles)
    Q = 1e-3 * np.random.default_rng(1).standard_normal((3, 6)) * 12.8
    readings = measured(angles, 5, Q) / 12.8
    linear, quadratic = normal_equations.two_stages(readings, force)
    staged = linear[:, 0] + readings @ linear[:, 1:].T + products(readings) @ quadratic.T
    sizes = [
        float(np.sqrt(np.mean((found - force) ** 2)))
        for found in (
            inverse_quadratic(readings, force).force_g(readings),
            staged,
            inverse_linear(readings, force).force_g(readings),
        )
    ]
    assert sizes[0] <= sizes[1] <= sizes[2]
    assert sizes[0] < 0.2 * sizes[2]


def sphere(count: int, seed: int) -> FloatArray:
    v = np.random.default_rng(seed).standard_normal((count, 3))
    result: FloatArray = v / np.linalg.norm(v, axis=1, keepdims=True)
    return result


def test_forms_with_quadratic_terms_find_a_quadratic_truth() -> None:
    """Exact forward physics; both ways come within the second order of its terms of it."""
    force = sphere(60, 1)
    D2 = 1e-4 * np.random.default_rng(4).standard_normal((3, 5)) @ TRACELESS
    readings = force @ D.T + D0 + 12.8 * products(force) @ D2.T
    other = sphere(200, 2)
    seen = other @ D.T + D0 + 12.8 * products(other) @ D2.T
    inverse, forward = inverse_quadratic(readings, force), SerialGrid.of(force, quadratic=True)
    # Terms of 2e-4 g: what is left is of second order, some 1e-7; the linear model misses 2e-4.
    assert np.abs(inverse.force_g(seen) - other).max() < 1e-6
    assert np.abs(forward.fit(readings).force_g(seen) - other).max() < 1e-6
    assert np.abs(inverse_linear(readings, force).force_g(seen) - other).max() > 1e-4
    solved = solve_serial(forward.unknowns(readings), seen, shortcut=False)
    assert np.abs(solved - forward.fit(readings).force_g(seen)).max() < 1e-12


def test_the_shortcut_38_needs_scale_factors_near_1() -> None:
    force = sphere(60, 1)
    near = np.eye(3) + np.array([[0, 1e-4, -2e-4], [-1e-4, 0, 3e-4], [2e-4, -3e-4, 0]])
    for matrix, worst in ((near, 1e-6), (near * 1.01, 3e-2)):
        unknowns = SerialGrid.of(force).unknowns(force @ matrix.T)
        error = np.abs(solve_serial(unknowns, force @ matrix.T, shortcut=True) - force).max()
        assert worst / 30.0 < error < worst  # second order of 3e-4, or 2 * 0.01


def test_the_ten_by_ten_matrix_of_29_is_singular() -> None:
    force = gravity_direction(AIRCRAFT, grid())
    ten = np.concatenate([np.ones((25, 1)), force, products(force)], axis=1)
    assert np.linalg.matrix_rank(ten, tol=1e-10) == 9


# ---- section 2 ----


def test_a_full_turn_shows_bias_and_scale() -> None:
    roll = np.radians(np.arange(0.0, 360.0, 15.0))
    angles = np.stack([np.zeros(24), roll], axis=1)
    turn = full_turn(roll, gravity_direction(AIRCRAFT, angles) @ D.T + D0)
    assert turn is not None
    assert np.abs(turn.mean - D0).max() < 1e-12
    assert np.abs(turn.amplitude - np.hypot(D[:, 1], D[:, 2])).max() < 1e-12
    assert turn.second.max() < 1e-12
    assert full_turn(roll[:12], D0 + np.zeros((12, 3))) is None  # half a turn is none


def test_a_tilted_plane_is_measured_by_its_azimuths() -> None:
    """The table turned as a whole by exact rotations, 40 arcsec about each horizontal axis."""
    random = np.random.default_rng(5)
    angles = np.stack([*random.uniform(-1.0, 1.0, (2, 60)), random.uniform(0, 6.28, 60)], axis=1)
    e = 40.0 * ARCSEC
    plumb = np.array([np.sin(e), -np.sin(e) * np.cos(e), np.cos(e) ** 2])
    A = direction_cosines(AIRCRAFT, angles)
    residual = A @ plumb - gravity_direction(AIRCRAFT, angles)
    tilt, explained, _ = plane_tilt(AIRCRAFT, angles, residual, 1.0)
    # e is 2e-4: second order is 4e-8.
    assert np.abs(np.abs(tilt) - e).max() < 1e-7
    assert explained > 0.999
