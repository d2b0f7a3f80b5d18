"""Functions over temperature in one solution of an IMU: exactness, choice, coverage."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from dynamic_cases import held
from thermal_cases import TURNS, Judged, five_points, judged, solved, three_ramps, true_at, truth_of
from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.blocks.base import GYRO_MATRIX
from triaxcal.dynamic.blocks.block import Signals
from triaxcal.dynamic.temperatures import Recorded
from triaxcal.dynamic.thermalbasis import GROUPS, Basis, block_over_temperature
from triaxcal.dynamic.thermalcurves import thermal_models, values_at
from triaxcal.dynamic.thermalnodes import nodes_of
from triaxcal.model.curves import PiecewisePolynomial, on_common_breaks
from triaxcal.model.thermal.registry import THERMAL_FUNCTIONS
from triaxcal.simulation.imu import simulate_imu
from triaxcal.simulation.imu_grades import MEMS, draw_truth
from triaxcal.simulation.imu_motion import ImuMotion, Mounting
from triaxcal.simulation.imu_temperature import TemperatureRamp
from triaxcal.simulation.imu_truth import Curved
from triaxcal.unit.thermal import ThermalChoice

NODES = np.array([-40.0, -10.0, 20.0, 50.0, 85.0])
SHAPES = tuple(s for f in THERMAL_FUNCTIONS for s in f.candidates(NODES, 20.0))


@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: s.label)
def test_every_candidate_is_in_the_span_at_temperature_points(shape: object) -> None:
    """Five temperatures have five values: any function through them is one of the span."""
    basis = Basis.spanning(SHAPES, 20.0, np.repeat(NODES, 3))
    assert basis.terms == 4
    value, change = basis.of_shape(shape)  # type: ignore[arg-type]
    exact = shape.basis(NODES)  # type: ignore[attr-defined]
    assert np.allclose(value + basis(NODES) @ change, exact, rtol=0, atol=1e-9)
    assert np.allclose(basis(np.array([20.0])), 0.0, atol=1e-12)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_polynomials_are_in_the_span_of_a_ramp_exactly(order: int) -> None:
    ramp = np.linspace(-40.0, 85.0, 500)
    basis = Basis.spanning(SHAPES, 20.0, ramp)
    shape = THERMAL_FUNCTIONS["polynomial"].stated({"order": order}, NODES, 20.0)[0]
    value, change = basis.of_shape(shape)
    error = value + basis(ramp) @ change - shape.basis(ramp)
    assert np.abs(error).max() < 1e-9


def test_rows_over_temperature_are_the_block_s_rows_times_the_functions() -> None:
    basis = Basis.spanning(SHAPES, 20.0, np.linspace(-40.0, 85.0, 50))
    block = block_over_temperature(GYRO_MATRIX, basis, 20.0)
    rate = np.array([[0.1, -0.2, 0.3], [0.5, 0.4, -0.6]])
    degc = np.array([-30.0, 60.0])
    signals = Signals(rate, rate, rate, degc - 20.0, 9.81)
    assert block.rate is not None
    rows = block.rate(signals).reshape(2, 3, 9, basis.terms)
    for k in range(2):
        for i in range(3):
            for j in range(3):
                expected = rate[k, j] * basis(degc[k : k + 1])[0]
                assert np.allclose(rows[k, i, 3 * i + j], expected, atol=1e-15)
    assert np.count_nonzero(rows[0, 0].any(axis=-1)) == 3


def test_functions_on_common_breaks_are_the_same_functions() -> None:
    rng = np.random.default_rng(1)
    one = PiecewisePolynomial((-40.0, 0.0, 85.0), (-40.0, 20.0), rng.normal(size=(2, 3, 4)))
    two = PiecewisePolynomial((-40.0, 20.0, 50.0, 85.0), (20.0, 20.0, 50.0),
                              rng.normal(size=(3, 2, 2)))  # fmt: skip
    breaks, origins, parts = on_common_breaks((one, two), 20.0)
    assert breaks == (-40.0, 0.0, 20.0, 50.0, 85.0)
    temps = np.linspace(-40.0, 85.0, 41)
    for whole, part in zip((one, two), parts, strict=True):
        found = PiecewisePolynomial(breaks, origins, part)(temps)
        # Cubics of 125 degC: powers of 2e6, rounded to 1e-16.
        assert np.allclose(found, whole(temps), rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    ("degc", "nodes", "t0"),
    [
        (np.repeat([-40.0, -10.0, 20.5, 50.0], 9), [-40.0, -10.0, 20.0, 50.0], 20.0),
        (np.linspace(-40.0, 85.0, 100), [-27.5, -2.5, 20.0, 47.5, 72.5], 20.0),
        (np.repeat([40.0, 60.0], 5), [40.0, 60.0], 40.0),
        (np.full(9, 23.0), [23.0], 23.0),
        # A ramp with a gap: five steps in all, rounded up on each side of it.
        (
            np.append(np.linspace(-41.0, 25.0, 60), np.linspace(45.0, 86.0, 40)),
            [-32.75, -16.25, 0.25, 20.0, 55.25, 75.75],
            20.0,
        ),
    ],
)
def test_nodes_are_points_or_steps_of_a_ramp(
    degc: np.ndarray, nodes: list[float], t0: float
) -> None:
    found = nodes_of(Recorded(np.arange(len(degc)) * 5.0, degc), 20.0)
    assert found.degc.tolist() == pytest.approx(nodes)
    assert found.t0_degc == t0


@cache
def of_points() -> Judged:
    truth = truth_of(1)
    return judged(truth, five_points(truth, 1))


@cache
def of_ramps() -> Judged:
    truth = truth_of(1)
    return judged(truth, three_ramps(truth, 1))


@pytest.mark.parametrize("found", [of_points, of_ramps], ids=["points", "ramps"])
def test_all_constants_are_covered_over_the_whole_range(found: object) -> None:
    """21 constants at 17 temperatures, which are at most 4 independent values each."""
    z = found().z  # type: ignore[operator]
    # 84 independent values: beyond 4.5 once in 1800; the mean of their squares beyond 1.6 less
    # often. Uncertainty for what other functions differ makes them smaller, never larger.
    assert np.abs(z).max() < 4.5
    assert float((z**2).mean()) < 1.6


def test_cubics_are_found_in_every_group_from_points() -> None:
    shapes = of_points().solved.over.choice.fit.shapes
    assert {s.label for s in shapes.values()} == {"polynomial of order 3"}


def test_the_curves_of_the_c_are_those_of_the_groups() -> None:
    over = of_points().solved.over
    fit, temps = over.choice.fit, np.array([-33.0, 12.0, 71.0])
    accel, gyro = thermal_models(fit, over.nodes.t0_degc, over.gyro_nodes.t0_degc)
    bias = values_at(fit, GROUPS[0], temps) / 9.80665
    assert np.allclose(accel.constants_at(temps)[:, 9:], bias, atol=1e-12)
    theta = values_at(fit, GROUPS[3], temps)
    expected = np.eye(3).ravel() + theta
    assert np.allclose(gyro.constants_at(temps)[:, :9], expected, atol=1e-12)


def test_a_stated_function_is_taken() -> None:
    truth = truth_of(1)
    stated = ThermalChoice("piecewise-linear", {"knots_degc": (20.0,)})
    found = solved(truth, five_points(truth, 1), stated).over
    assert {s.name for s in found.choice.fit.shapes.values()} == {"piecewise-linear"}
    assert found.choice.candidates == {}


def test_an_order_that_the_temperatures_do_not_determine_is_refused() -> None:
    truth = truth_of(1)
    with pytest.raises(RefusedError, match="order 5 with 5 calibrated temperatures"):
        solved(truth, five_points(truth, 1), ThermalChoice("polynomial", {"order": 5}))


def test_a_quadratic_bias_in_a_few_degrees_is_found_or_bounded() -> None:
    """0.01 mm/s^2/K^2 from 20 to 28 degC: 0.64 mm/s^2 at the end, with 0.1 mm/s^2 of noise."""
    truth = draw_truth(MEMS, 5)
    bend = (0.01 * 60**2, 0.0, 0.0)
    zero3, zero9 = (0.0,) * 3, (0.0,) * 9
    curved = Curved((zero3, bend, zero3), (zero3,) * 3, (zero9,) * 3, (zero9,) * 3)  # type: ignore[arg-type]
    truth = replace(truth, curved=curved)
    mountings = tuple(Mounting(TURNS * 2, 12.0) for _ in range(3))
    flat = ImuMotion(mountings)
    motion = ImuMotion(mountings, temperature=TemperatureRamp(19.9, 28.1, flat.duration_s))
    recording = held(simulate_imu(truth, motion, 25.0, 5))
    known = solved(truth, recording).over.known
    z = (known.value - true_at(truth, known.temps_degc)) / known.sd
    # 21 constants over 8 K: 50 independent values, beyond 4.5 once in 3000.
    assert np.abs(z).max() < 4.5
    change = known.value[-1, 0] - known.value[0, 0]
    assert abs(change - 1e-3 * 0.01 * (8.1**2 - 0.1**2)) < 4.5 * np.hypot(*known.sd[[0, -1], 0])
