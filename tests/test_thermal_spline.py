"""The natural cubic spline: against SciPy's, through the choice by held-out error, to proven C."""

from __future__ import annotations

import shutil
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from fit_cases import SEVEN, readings, unit
from triaxcal.base.errors import RefusedError
from triaxcal.codegen.crosscheck import vector_sets
from triaxcal.codegen.routines import Generated, start_generated
from triaxcal.delivery import unit as delivery_module
from triaxcal.delivery.unit import deliver
from triaxcal.fitting.recorded.temperatures import temperature_groups, thermal_shapes
from triaxcal.fitting.tilter.calibrate import calibrate
from triaxcal.model.metrological import force_from_voltage, voltage_from_force
from triaxcal.model.positions import TEST_POSITIONS
from triaxcal.model.thermal.cubic_spline import CubicSplineShape
from triaxcal.model.types import FloatArray
from triaxcal.unit.thermal import ThermalChoice

UNITS = Path(__file__).parent.parent / "units"
EPS = np.finfo(float).eps
KNOTS = [(-40.0, 70.0), (-40.0, 20.0, 70.0), SEVEN, (-40.0, 10.0, 30.0, 70.0)]


def natural(knots: FloatArray, values: FloatArray) -> CubicSpline:
    """SciPy's spline through values (..., K); it continues beyond the ends as ours does."""
    return CubicSpline(knots, values, axis=-1, bc_type="natural")


@pytest.mark.parametrize("knots", KNOTS)
def test_curves_and_basis_are_those_of_scipy(knots: tuple[float, ...]) -> None:
    shape = CubicSplineShape.over(np.array(SEVEN), 20.0, knots)
    assert shape.knots_degc == knots
    temps = np.linspace(-41.0, 71.0, 225)
    values = np.random.default_rng(7).normal(size=(12, len(knots)))
    expected = natural(np.array(knots), values)(temps).T
    # Numbers of order 1; the solve of a diagonally dominant system and Horner lose a few eps.
    np.testing.assert_allclose(shape.basis(temps) @ values.T, expected, atol=200 * EPS)
    model = shape.model(values)
    np.testing.assert_allclose(model.constants_at(temps), expected, atol=2000 * EPS)
    assert model.curves.order == 3
    assert len(model.curves.origins_degc) == len(knots) - 1


@given(
    st.lists(st.integers(-60, 120), min_size=2, max_size=9, unique=True),
    st.floats(-70, 130),
    st.integers(0, 2**32 - 1),
)
def test_the_conversion_is_exact_whatever_the_knots(knots: list[int], t0: float, seed: int) -> None:
    rising = np.array(sorted(knots), dtype=float)
    shape = CubicSplineShape(t0, (rising[0], rising[-1]), tuple(rising))
    values = np.random.default_rng(seed).normal(size=(2, len(rising)))
    temps = np.linspace(rising[0], rising[-1], 101)
    expected = natural(rising, values)(temps).T
    size = max(1.0, float(np.abs(expected).max()))
    np.testing.assert_allclose(shape.basis(temps) @ values.T, expected, atol=1e4 * EPS * size)
    # Coefficients about T0 instead of the knot: (distance of the knots)^3 cancels, 180^3 at most
    # over a closest distance of 1.
    curves = shape.curves(values)(temps)
    np.testing.assert_allclose(curves, expected, atol=1e4 * 180 * EPS * size)


def test_slope_and_curvature_are_continuous_and_the_ends_straight() -> None:
    shape = CubicSplineShape.over(np.array(SEVEN), 20.0, SEVEN)
    curves = shape.curves(np.random.default_rng(3).normal(size=(12, 7)))
    knots = np.array(SEVEN)
    origins, c = np.array(curves.origins_degc), curves.coefficients
    for at, below, above in zip(knots[1:-1], range(5), range(1, 6), strict=True):
        for n in range(3):  # value, slope, curvature
            sides = [
                np.polynomial.polynomial.polyval(
                    at - origins[s], np.polynomial.polynomial.polyder(c[s].T, n)
                )
                for s in (below, above)
            ]
            np.testing.assert_allclose(sides[0], sides[1], atol=1e-12)
    for s, at in ((0, knots[0]), (-1, knots[-1])):
        curvature = 2 * c[s, :, 2] + 6 * c[s, :, 3] * (at - origins[s])
        np.testing.assert_allclose(curvature, 0.0, atol=1e-14)


def test_a_line_is_given_back() -> None:
    shape = CubicSplineShape.over(np.array(SEVEN), 20.0, SEVEN)
    temps = np.linspace(-41.0, 71.0, 50)
    basis = shape.basis(temps)
    np.testing.assert_allclose(basis.sum(axis=1), 1.0, atol=50 * EPS)
    np.testing.assert_allclose(basis @ np.array(SEVEN), temps, atol=50 * EPS * 70)


def test_without_a_temperature_a_knot_goes() -> None:
    temps = np.array(SEVEN)
    remaining = np.delete(temps, 2)  # 0 degC
    dense = CubicSplineShape.over(temps, 20.0, SEVEN).without(remaining, 0.0)
    assert isinstance(dense, CubicSplineShape)
    assert dense.knots_degc == tuple(remaining)
    few = CubicSplineShape.over(temps, 20.0).without(remaining, 0.0)
    assert few.knots_degc == (-40.0, 20.0, 70.0)


def test_a_knot_that_nothing_determines_is_named() -> None:
    knots = {"knots_degc": (22.0, 23.0, 24.0, 25.0, 26.0, 27.0)}
    with pytest.raises(RefusedError) as caught:
        calibrate(
            unit(thermal=ThermalChoice("cubic-spline", knots)), readings(spline_truth(), SEVEN)
        )
    message = str(caught.value)
    assert message.startswith(
        "units/AT-TEST/unit.toml, [thermal] knots_degc: nothing determines the"
    )
    assert "calibrated temperatures are -40, -20, 0, 20, 40, 55, 70 degC" in message
    assert "\n" not in message


def spline_truth(knots: tuple[float, ...] = (-40.0, 20.0, 70.0)):
    """Constants that follow a natural cubic spline, of the size of tables 1 and 2 of P1."""
    from fit_cases import TABLES

    random = np.random.default_rng(8)
    at_knots = TABLES[1] + random.normal(size=(len(knots), 12)) * 2e-3
    spline = CubicSpline(knots, at_knots, bc_type="natural")

    def truth(temp_degc: FloatArray) -> FloatArray:
        result: FloatArray = spline(np.asarray(temp_degc, dtype=np.float64))
        return result

    return truth


@pytest.mark.parametrize("few", [True, False])
def test_auto_takes_the_spline_where_the_unit_is_one(few: bool) -> None:
    temps = SEVEN if few else tuple(np.linspace(-40.0, 70.0, 23))
    knots = (-40.0, 20.0, 70.0) if few else temps
    data = readings(spline_truth() if few else wave, temps, sd_v=1e-7, count=100, seed=5)
    calibration = calibrate(unit(t0_degc=20.0), data)
    (row,) = [c for c in calibration.candidates if c.chosen]
    assert row.shape.name == "cubic-spline"
    assert len(row.shape.knots_degc) == len(knots)
    assert row.short_label == f"natural cubic spline, {len(knots)} knots"
    assert calibration.selection_reason.startswith(row.label)
    # A spline of the truth is found again, to the noise of the readings: 1e-7 V / 10, a few times
    # that between knots. Of a wave straight lines between points miss h^2 max|f''| / 8, h = 5 degC;
    # a spline less, and by as much at most where its ends are straight and the wave is not.
    between = np.linspace(-39.0, 69.0, 301)
    truth = spline_truth()(between) if few else wave(between)
    error = np.abs(calibration.thermal.constants_at(between) - truth).max()
    assert error <= (1e-7 if few else 5.0**2 / 8.0 * 1e-3 / 5.9**2)


def wave(temp_degc: FloatArray) -> FloatArray:
    """A wave of 37 degC in all constants, which no polynomial up to order 7 follows."""
    from fit_cases import TABLES

    temp = np.asarray(temp_degc, dtype=np.float64)
    result: FloatArray = TABLES[1] + 1e-3 * np.sin(temp / 5.9)[..., None]
    return result


def test_the_held_out_error_is_that_of_a_spline_of_scipy() -> None:
    """With a knot at each temperature every fold is a spline through the points that remain."""
    data = readings(spline_truth(), SEVEN, sd_v=1e-5, seed=4)
    choice = ThermalChoice("cubic-spline", {"knots_degc": SEVEN})
    calibration = calibrate(unit(thermal=choice, estimator="equation-10"), data)
    points = np.array([p.constants for p in calibration.points])
    squares = []
    for k in range(1, 6):
        kept = np.delete(np.arange(7), k)
        constants = CubicSpline(np.array(SEVEN)[kept], points[kept], bc_type="natural")(SEVEN[k])
        for d in data.dwells[6 * k : 6 * k + 6]:
            assert d.temp_degc == SEVEN[k]
            force = force_from_voltage(constants, np.array(d.voltage_v))
            squares.extend((force - np.array(TEST_POSITIONS[d.position])) ** 2)
    assert len(squares) == 90
    expected = np.sqrt(np.mean(squares))
    assert calibration.candidates[0].held_out_g == pytest.approx(expected, rel=1e-9)


def test_without_knots_the_held_out_error_chooses_between_few_and_all() -> None:
    data = readings(spline_truth(), SEVEN, sd_v=1e-7, count=100)
    made = calibrate(unit(thermal=ThermalChoice("cubic-spline")), data)
    assert {c.short_label for c in made.candidates} == {
        "natural cubic spline, 3 knots",
        "natural cubic spline, 7 knots",
    }
    assert made.shape.settings == {"knots_degc": (-40.0, 20.0, 70.0)}


def test_the_whole_road_to_proven_c(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The compiled C against K^-1 (U - U0) with SciPy's spline through the fitted values."""
    folder = tmp_path / "AT-SIM"
    shutil.copytree(UNITS / "AT-SIM", folder)
    text = (folder / "unit.toml").read_text(encoding="utf-8")
    knots = "knots_degc = [-40, -20, 0, 20, 40, 55, 70]"
    asked = text.replace("[thermal]\n", f'[thermal]\nmodel = "cubic-spline"\n{knots}\n')
    (folder / "unit.toml").write_text(asked, encoding="utf-8")
    monkeypatch.setattr(delivery_module, "vector_sets", partial(vector_sets, random_vectors=20_000))
    delivery = deliver(folder)
    thermal = delivery.calibration.thermal
    assert (
        delivery.calibration.shape.label
        == "natural cubic spline, knots -40, -20, 0, 20, 40, 55, 70 degC"
    )
    assert delivery.plan.shape.segments == 6
    for name, content in delivery.files.items():
        (tmp_path / name).write_bytes(content)
    routine = Generated(start_generated(tmp_path, tmp_path).load())
    unit_ = delivery.unit
    at = np.array(SEVEN)
    spline = CubicSpline(at, thermal.constants_at(at), bc_type="natural")
    codes = np.arange(-40 * 128, 70 * 128 + 1, 7, dtype=np.int32)
    constants = spline(codes / 128.0)
    random = np.random.default_rng(2)
    force = random.normal(size=(len(codes), 3))
    voltage = voltage_from_force(constants, force / np.linalg.norm(force, axis=1, keepdims=True))
    raw = np.rint(voltage / unit_.adc.volts_per_code).astype(np.int32)
    accel, status = routine.run(codes, raw)
    assert not status.any()
    exact = force_from_voltage(constants, raw * unit_.adc.volts_per_code)
    allowed = delivery.bound.lsb * 2.0**-unit_.output_q + delivery.model_error_g
    # 1e-12: two evaluations of one spline in floating point.
    assert np.abs(accel * 2.0**-unit_.output_q - exact).max() <= allowed + 1e-12
    assert (
        b"thermal model: natural cubic spline, knots -40, -20, 0, 20, 40, 55, 70 degC"
        in delivery.files["triax_calib.h"]
    )


def test_a_recording_tries_nested_functions_only() -> None:
    """Its constants are fitted with the first functions of a basis, which a spline's are not."""
    temps = np.linspace(-20.0, 60.0, 40)
    groups = temperature_groups(temps)
    order_0 = unit(thermal=ThermalChoice("polynomial", {"order": 0}))
    assert [s.label for s in thermal_shapes(order_0, temps, groups)] == ["polynomial of order 0"]
    tried = [s.label for s in thermal_shapes(unit(), temps, groups)]
    assert tried == [f"polynomial of order {n}" for n in range(4)]
    with pytest.raises(RefusedError) as caught:
        thermal_shapes(unit(thermal=ThermalChoice("cubic-spline")), temps, groups)
    assert str(caught.value) == (
        'units/AT-TEST/unit.toml, [thermal] model: "cubic-spline" for a recording; '
        'expected "polynomial" or "auto"'
    )
