"""What a program can ask of a table: forms of P0, a series inverse, errors over an angle."""

from __future__ import annotations

import numpy as np
import pytest
from test_oriented import D0, D, grid

import triaxcal
from triaxcal.fitting.table.oriented import TRACELESS
from triaxcal.model.orientation import angles_from_force, gravity_direction
from triaxcal.model.terms import products
from triaxcal.model.types import FloatArray

KINDS = {"aircraft": ("pitch", "roll"), "inclinometer": ("zenith", "tool_face")}
ARCSEC = np.pi / 180.0 / 3600.0
GRID_DEG = np.degrees(grid())
INCLINED = np.stack(
    np.meshgrid([20.0, 60.0, 100.0, 140.0], np.arange(0.0, 360.0, 45.0), indexing="ij"), axis=-1
).reshape(-1, 2)
Q = np.zeros((3, 6))
Q[[0, 0, 1, 2], [2, 4, 5, 0]] = [3e-4, 2e-4, -2e-4, 4e-4]


def readings(force: FloatArray, noise: float = 0.0, seed: int = 0) -> FloatArray:
    """Readings of the AK-15 of P0's table 2 with a quadratic part."""
    exact = (force + products(force) @ Q.T) @ D.T + D0
    return exact + noise * np.random.default_rng(seed).standard_normal(force.shape)


def test_two_stages_are_the_direct_solution_and_as_printed_they_are_not() -> None:
    table = triaxcal.TableGrid("aircraft", GRID_DEG)
    values = readings(table.force_g, 13.0 * 3e-6)
    direct = table.fit(values, quadratic=True)
    staged = table.fit(values, quadratic=True, form="two-stage")
    printed = table.fit(values, quadratic=True, form="two-stage-as-printed")
    assert direct.quadratic is not None
    assert staged.quadratic is not None
    # Readings of 13 rounded to 1e-16 of themselves, a design of condition 671, six rounds.
    tolerance = 6 * 671 * 13 * 2.0**-52
    assert np.abs(staged.quadratic - direct.quadratic).max() < tolerance
    assert np.abs(staged.force_g(values) - direct.force_g(values)).max() < tolerance
    between = np.degrees(np.random.default_rng(1).uniform(-0.5, 0.5, (200, 2)))
    force = triaxcal.TableGrid("aircraft", between).force_g
    rms = {
        name: float(np.sqrt(np.mean((fit.force_g(readings(force)) - force) ** 2)))
        for name, fit in (("direct", direct), ("printed", printed))
    }
    # 3 micro-g of noise, nine unknowns of 25; the linear function leaves 13 micro-g.
    assert rms["direct"] < 3e-6
    assert rms["printed"] > 2.0 * rms["direct"]


@pytest.mark.parametrize("quadratic", [False, True])
def test_an_inverse_once_a_series_is_the_direct_solution(quadratic: bool) -> None:
    table = triaxcal.TableGrid("aircraft", GRID_DEG)
    plain = table.serial(quadratic=quadratic)
    centred = table.serial(quadratic=quadratic, centred=True)
    assert plain.operator.shape == (9 if quadratic else 4, 25)
    ones, bent = np.ones((25, 1)), products(table.force_g) @ TRACELESS.T
    design = np.concatenate([ones, table.force_g, bent] if quadratic else [ones, table.force_g], 1)
    for seed in range(3):
        values = readings(table.force_g, 13.0 * 3e-6, seed)
        direct = np.linalg.lstsq(design, values, rcond=None)[0].T
        # An inverse is known to its condition number by 2^-52, and is then multiplied.
        size = float(np.linalg.norm(plain.operator) * np.linalg.norm(values))
        tolerance = float(np.linalg.cond(design)) * size * 2.0**-52
        assert np.abs(plain.unknowns(values) - direct).max() < tolerance
        assert np.abs(centred.unknowns(values) - direct).max() < tolerance
        found = plain.fit(values).force_g(values) - table.force_g
        # Forward and inverse differ by second order in Q, and by the noise in the readings.
        inverse = table.fit(values, quadratic=quadratic).force_g(values) - table.force_g
        assert np.sqrt(np.mean(found**2)) == pytest.approx(np.sqrt(np.mean(inverse**2)), rel=0.02)


@pytest.mark.parametrize("kind", KINDS)
def test_errors_of_the_angles_are_their_sensitivities_times_the_errors(kind: str) -> None:
    """First order: what is left is of the square of 1e-4, by the cosine that angles can have."""
    random = np.random.default_rng(3)
    size = 1e-4
    offset, scale = size * random.standard_normal((2, 3))
    e = size * random.standard_normal((3, 3)) * (1.0 - np.eye(3))
    for swept, fixed in zip(KINDS[kind], (35.0, 50.0), strict=True):
        found = triaxcal.study_angle_errors(
            kind, swept, fixed, offset_g=offset, scale=scale, misalignment_rad=e
        ).result
        expected = (
            found.per_offset @ (offset * 1e3)
            + found.per_scale @ (scale * 1e3)
            + np.einsum("nkij,ij->nk", found.per_misalignment, np.degrees(e) * 3600.0)
        )
        left = np.abs(found.angle_error_arcsec - expected)
        circle = np.linalg.norm(
            gravity_direction(kind, np.radians(found.angles_deg))[:, 1:], axis=1
        )
        steady = (
            circle > 0.2 if kind == "aircraft" else np.sin(np.radians(found.angles_deg[:, 0])) > 0.2
        )
        assert np.nanmax(left[steady]) < 20.0 * size**2 / 0.2**2 / ARCSEC
        assert np.nanmax(np.abs(expected)) > 10.0


def test_a_bias_of_1_mg_is_what_everyone_knows() -> None:
    """1 mg of x at pitch 0 is 1e-3 rad, 206 arcsec; a scale does nothing there."""
    found = triaxcal.study_angle_errors("aircraft", "pitch", 0.0, offset_g=[1e-3, 0.0, 0.0])
    level = 180
    assert found.result.angles_deg[level, 0] == 0.0
    assert found.result.per_offset[level, 0, 0] == pytest.approx(-206.26, abs=0.01)
    assert found.result.angle_error_arcsec[level, 0] == pytest.approx(-206.26, abs=0.01)
    assert np.abs(found.result.per_scale[level, 0]).max() < 1e-9
    assert found.result.force_error_g[:, 0] == pytest.approx(1e-3)
    assert "206" in found.summary
    assert found.picture().startswith(b"<svg")
    # At pitch 90 deg there is no roll.
    assert np.isnan(found.result.per_offset[0, 1]).all()


@pytest.mark.parametrize(("kind", "angles"), [("aircraft", GRID_DEG), ("inclinometer", INCLINED)])
def test_a_stand_out_of_square_is_known_or_found(kind: str, angles: FloatArray) -> None:
    true = triaxcal.TableGrid(kind, angles, orthogonality_arcsec=40.0)
    assert np.abs(np.linalg.norm(true.force_g, axis=1) - 1.0).max() < 1e-15
    errors, stated = [], []
    for seed in range(40):
        noise = 3e-6 * np.random.default_rng(seed).standard_normal(true.force_g.shape)
        values = (true.force_g + noise) @ D.T + D0
        found = triaxcal.TableGrid(kind, angles).orthogonality(values)
        errors.append(found.value_rad / ARCSEC - 40.0)
        stated.append(found.sd_rad / ARCSEC)
    rms = float(np.sqrt(np.mean(np.square(errors))))
    assert rms < 4.0
    # 40 runs: an rms is known to 11 %.
    assert float(np.mean(stated)) == pytest.approx(rms, rel=0.35)
    values = true.force_g @ D.T + D0
    known = true.fit(values).force_g(values) - true.force_g
    unknown = triaxcal.TableGrid(kind, angles)
    left = unknown.fit(values).force_g(values) - unknown.force_g
    assert np.abs(known).max() < 1e-12
    assert np.abs(left).max() > 1e-5


def test_a_stand_out_of_square_is_the_rotation_that_it_says() -> None:
    """Roll about x that is turned by e towards y, by rotations alone."""
    e, pitch, roll = 0.1, np.radians(30.0), np.radians(20.0)

    def turn(axis: int, angle: float) -> FloatArray:
        i, j = [(1, 2), (2, 0), (0, 1)][axis]
        matrix = np.eye(3)
        matrix[[i, j], [i, j]] = np.cos(angle)
        matrix[i, j], matrix[j, i] = np.sin(angle), -np.sin(angle)
        return matrix

    plumb = turn(0, roll) @ turn(2, e) @ turn(1, pitch) @ np.array([0.0, 0.0, 1.0])
    found = triaxcal.TableGrid("aircraft", [[30.0, 20.0]], orthogonality_arcsec=e / ARCSEC)
    assert found.force_g[0] == pytest.approx(plumb, abs=1e-12)


def test_hysteresis_shows_from_both_sides_and_as_a_turn_from_one() -> None:
    roll = np.arange(0.0, 360.0, 15.0)
    table = triaxcal.TableGrid("aircraft", np.stack([np.full(24, 10.0), roll], axis=1))
    force, noise, width = table.force_g, 3e-6, np.array([0.0, 2e-5, 5e-5])
    slope = (
        np.cos(np.radians(10.0))
        * np.array([0.0, 1.0, 1.0])
        * np.stack([np.zeros(24), np.cos(np.radians(roll)), -np.sin(np.radians(roll))], axis=1)
    )
    random = np.random.default_rng(5)
    rising, falling = (
        force - sign * width * np.sign(np.round(slope, 9)) + noise * random.standard_normal((24, 3))
        for sign in (1.0, -1.0)
    )
    found = table.hysteresis(rising, falling, "roll")
    # x does not move when roll turns: nothing is known of it.
    assert np.isnan(found.width[0])
    assert found.seen == (False, True, True)
    assert np.abs(found.width[1:] - width[1:]).max() < 4.0 * found.sd[1:].max()
    assert found.sd[1:].max() < 1.5 * noise / np.sqrt(2 * 20)
    same = table.hysteresis(force + noise * random.standard_normal((24, 3)), force, "roll")
    assert same.seen == (False, False, False)
    # From one side alone: a fit takes z for turned by 4 h / pi about x.
    one_way = force - width * np.sign(np.round(slope, 9))
    K = table_fit_of_turn(roll, one_way[:, 2])
    assert pytest.approx(4.0 / np.pi * width[2] / np.cos(np.radians(10.0)), rel=0.02) == K


def table_fit_of_turn(roll: FloatArray, reading: FloatArray) -> float:
    """Size of the part of z that follows sin(roll), over the amplitude of its cosine."""
    t = np.radians(roll)
    design = np.stack([np.ones_like(t), np.cos(t), np.sin(t)], axis=1)
    _, c, s = np.linalg.lstsq(design, reading, rcond=None)[0]
    return float(abs(s / c))


def test_angles_come_back_and_bad_arguments_are_refused() -> None:
    table = triaxcal.TableGrid("inclinometer", INCLINED)
    back = (table.angles_deg(table.force_g) - INCLINED + 180.0) % 360.0 - 180.0
    assert np.abs(back).max() < 1e-9
    assert angles_from_force("inclinometer", table.force_g).shape == (32, 2)
    for call, words in (
        (lambda: triaxcal.TableGrid("ship", INCLINED), 'kind: "ship"'),
        (lambda: triaxcal.TableGrid("aircraft", [1.0, 2.0]), "angles_deg: an array of shape"),
        (lambda: table.fit([[1.0, 2.0, 3.0]]), "readings: 1 rows; expected 32"),
        (lambda: table.fit(table.force_g, quadratic=True, form="x"), 'form: "x"'),
        (lambda: table.hysteresis(table.force_g, table.force_g, "yaw"), 'swept: "yaw"'),
        (lambda: triaxcal.study_angle_errors("aircraft", "zenith", 0.0), 'swept: "zenith"'),
        (lambda: triaxcal.study_angle_errors("aircraft", "roll", 0.0, scale=[1.0]), "other shapes"),
    ):
        with pytest.raises(triaxcal.RefusedError) as refusal:
            call()
        assert words in str(refusal.value)
