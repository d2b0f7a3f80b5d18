"""The IMU from floats to C: gyro plan, proven bound, cross-check of both triads, refusals."""

from __future__ import annotations

import itertools
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import oracle
from builds import PROVENANCE
from plans import SENSOR
from triaxcal.base.errors import RefusedError
from triaxcal.codegen.forces import forces_of
from triaxcal.codegen.identity import IDENTITY_SIZE, identity_of
from triaxcal.codegen.image import image_bytes
from triaxcal.codegen.imu import ImuBuild, build_imu, rate_bound
from triaxcal.codegen.render import render_routine
from triaxcal.fixedpoint.gyro import TriadDescription, make_gyro_plan
from triaxcal.fixedpoint.integer_model import apply, set_temperature
from triaxcal.fixedpoint.plan import make_plan
from triaxcal.fixedpoint.proof import prove
from triaxcal.model.curves import PiecewisePolynomial, ThermalModel
from triaxcal.model.methods.imu import (
    EXAMPLE_SENSITIVITY,
    ImuCompensation,
    ImuModel,
    compensate_imu,
    constants_from_errors,
)
from triaxcal.model.terms import EXAMPLE_TERMS, NO_TERMS, Terms
from triaxcal.unit.adc import Adc
from triaxcal.unit.thermometer import TemperatureSensor

RANGE = (-40.0, 85.0)
COARSE = TemperatureSensor(degc_per_code=2.5, degc_at_zero=0.0)
DEGREE = np.pi / 180.0
ACCEL_ADC = Adc(24, 16.0, -(2**23), 2**23 - 1)
"""A digital unit: "V" is the nominal g, 16 of them full scale."""
GYRO_ADC = Adc(24, 500.0 * DEGREE, -(2**23), 2**23 - 1)
"""And the nominal rad/s, for 500 deg/s."""
G = EXAMPLE_SENSITIVITY


def triad(seed: int, bias: float, *, flat: bool = False) -> ThermalModel:
    """P2's errors at 20 degC, and their temperature coefficients, (23), (24), unless `flat`."""
    rng = np.random.default_rng(seed)
    constant = constants_from_errors(rng.normal(0, bias, 3), rng.normal(0, 0.01, (3, 3)))
    slopes = np.concatenate([rng.normal(0, 1e-4, 9), rng.normal(0, bias / 50, 3)])
    lines = np.stack([constant, slopes * (not flat)], axis=1)[None]
    return ThermalModel(20.0, PiecewisePolynomial(RANGE, (20.0,), lines))


def imu_of(
    method: str = "matrix", g: np.ndarray = G, terms: Terms = NO_TERMS, *, flat: bool = False
) -> ImuCompensation:
    model = ImuModel(triad(1, 0.05, flat=flat), triad(2, 0.5 * DEGREE, flat=flat), g, terms)
    readings = 16.0, 500.0 * DEGREE
    return compensate_imu(model, method, RANGE, readings, (1e-7, 1e-8))


def triads(
    sensor: TemperatureSensor = COARSE, rate_q: int = 19
) -> tuple[TriadDescription, TriadDescription]:
    return (
        TriadDescription("TEST", ACCEL_ADC, sensor, 24),
        TriadDescription("TEST", GYRO_ADC, sensor, rate_q),
    )


@pytest.mark.parametrize(("method", "rate_q"), [("matrix", 19), ("inverse", 19), ("matrix", 22)])
def test_the_integers_compute_the_float_model(method: str, rate_q: int) -> None:
    imu = imu_of(method)
    described = triads(rate_q=rate_q)
    accel = make_plan(imu.accel, described[0])
    gyro = make_gyro_plan(imu, described[1], accel.shape.output_q)
    assert gyro.shape.saturates == (rate_q == 22)
    rng = np.random.default_rng(6)
    codes = rng.integers(gyro.temp_min_code, gyro.temp_max_code, 300, endpoint=True)
    raw = rng.integers(-(2**23), 2**23, (2, 300, 3))
    force, _ = apply(accel, set_temperature(accel, codes)[0], raw[0])
    rate, status = apply(gyro, set_temperature(gyro, codes)[0], raw[1], force)
    volts = ACCEL_ADC.volts_per_code, GYRO_ADC.volts_per_code
    expected = imu(raw[0] * volts[0], raw[1] * volts[1], codes * COARSE.degc_per_code)[1]
    error_lsb = np.abs(rate - expected / DEGREE * 2.0**rate_q)[status == 0]
    assert len(error_lsb) > 30
    bound = rate_bound(gyro, prove(gyro), prove(accel))
    assert error_lsb.max() <= max(bound) + 2.0**-15  # 2^31 LSB in doubles, some ten operations


def test_the_bound_is_step_e_and_no_sample_exceeds_it() -> None:
    imu = imu_of()
    gyro = make_gyro_plan(imu, triads()[1], 24)
    bound = prove(gyro)
    assert gyro.sensitivity is not None
    assert gyro.real_sensitivity is not None
    low, high = gyro.shape.raw_min, gyro.shape.raw_max
    corners = [list(c) for c in itertools.product((low, high), repeat=3)]
    ends = [list(c) for c in itertools.product((-(2**31), 2**31 - 1), repeat=3)]
    words = gyro.sensitivity.tolist()
    real = [[Fraction(v) for v in row] for row in gyro.real_sensitivity.tolist()]
    seen = [Fraction(0)] * 3
    for code in gyro.temp_codes.tolist():
        rows, _ = oracle.set_temperature(gyro, code)
        exact_rows = oracle.real_gain_and_offset(gyro, code)
        for raw, force in itertools.product(corners, ends):
            found, _ = oracle.apply(gyro, rows, raw, force)
            exact = oracle.real_accel(gyro, exact_rows, raw)
            for i in range(3):
                more = sum(k * f for k, f in zip(real[i], force, strict=True))
                error = abs(found[i] - exact[i] - more / 2**gyro.shape.output_shift)
                assert error <= Fraction(bound.per_axis_lsb[i])
                seen[i] = max(seen[i], error)
    for i in range(3):
        rounding = sum(abs(k - r) for k, r in zip(words[i], real[i], strict=True))
        linear = max(oracle.error_bound(gyro, code)[i] for code in gyro.temp_codes.tolist())
        exact_bound = linear + rounding * 2**31 / 2**gyro.shape.output_shift
        stated = Fraction(bound.per_axis_lsb[i])
        assert exact_bound <= stated <= exact_bound * (1 + Fraction(1, 2**50))
        assert seen[i] >= stated * Fraction(3, 4)


def test_g_sensitivities_that_are_no_small_effect_are_refused() -> None:
    with pytest.raises(RefusedError) as refusal:
        make_gyro_plan(imu_of(g=np.diag([0.0, 30.0, 0.0])), triads()[1], 24)
    assert str(refusal.value) == (
        "unit TEST: g-sensitivities of axis y sum to 1719 (deg/s)/g; expected at most 2 for the "
        "formats chosen; check its unit, (rad/s)/g, and the fit"
    )
    with pytest.raises(RefusedError, match="a g-sensitivity is not a finite number"):
        make_gyro_plan(imu_of(g=np.full((3, 3), np.nan)), triads()[1], 24)
    gyro = make_gyro_plan(imu_of(), triads()[1], 24)
    broken = replace(gyro, sensitivity=np.array([[0, 0, 0], [0, 2**29 + 1, 0], [0, 0, 0]]))
    with pytest.raises(RefusedError, match="the g-sensitivities of axis y could overflow"):
        prove(broken)


def test_a_range_that_does_not_fit_is_named_in_deg_per_s() -> None:
    with pytest.raises(RefusedError, match=r"the declared raw range stands for 534.2 deg/s"):
        make_gyro_plan(imu_of(), triads(rate_q=30)[1], 24)


def test_forces_hold_none_ends_and_anything() -> None:
    rng = np.random.default_rng(1)
    temp, raw = rng.integers(-9, 9, 4000), rng.integers(-9, 9, (4000, 3))
    force = forces_of(temp, raw)
    assert np.array_equal(force, forces_of(temp.astype(np.int32), raw.astype(np.int32)))
    none = (force == 0).all(axis=1).mean()
    ends = np.isin(force, [-(2**31), 2**31 - 1]).all(axis=1).mean()
    # Binomial of 4000 at 1/4: five times the sd of 0.0068.
    assert abs(none - 0.25) < 0.035
    assert abs(ends - 0.25) < 0.035


# ---- the C ----


@pytest.fixture(scope="module", params=["matrix", pytest.param("inverse", marks=pytest.mark.slow)])
def built_imu(request: pytest.FixtureRequest) -> ImuBuild:
    """Both triads, the accelerometer with quadratic terms."""
    imu = imu_of(request.param, terms=EXAMPLE_TERMS)
    return build_imu(imu, triads(SENSOR), (PROVENANCE, PROVENANCE), random_vectors=20_000)


def test_three_implementations_agree_and_samples_come_near_the_bound(built_imu: ImuBuild) -> None:
    """What differs raises in `build_imu`."""
    assert built_imu.vectors == 20_000
    assert built_imu.gyro_check.images > 300
    for bound, check in (
        (built_imu.accel_bound, built_imu.accel_check),
        (built_imu.gyro_bound, built_imu.gyro_check),
    ):
        assert 0.75 * bound.lsb <= check.largest_error_lsb <= bound.lsb
    assert all(
        own < carried
        for own, carried in zip(
            built_imu.gyro_bound.per_axis_lsb, built_imu.rate_bound_lsb, strict=True
        )
    )


def test_the_gyros_files_have_names_of_their_own(built_imu: ImuBuild) -> None:
    files = {name: content.decode() for name, content in built_imu.files.items() if name[-2] == "."}
    assert set(files) == {
        "triax_comp.h", "triax_comp.c", "triax_calib.h", "triax_calib.c", "triax_gyro_comp.h",
        "triax_gyro_comp.c", "triax_gyro_calib.h", "triax_gyro_calib.c", "triax_imu.h",
        "triax_imu.c", "triax_selftest.h", "triax_selftest.c", "triax_gyro_selftest.h",
        "triax_gyro_selftest.c",
    }  # fmt: skip
    header = files["triax_gyro_comp.h"]
    assert "#define TRIAX_GYRO_RATE_Q 19 /* angular rate LSB = 2^-19 deg/s" in header
    assert "#define TRIAX_GYRO_FORCE_Q 24 " in header
    assert (
        "uint32_t triax_gyro_apply(const triax_gyro_state_t *state, const int32_t raw_code[3], "
        "const int32_t force[3], int32_t rate[3]);"
    ) in header
    assert "accel" not in files["triax_gyro_comp.c"].lower().replace("accelerometer", "")
    for name in ("triax_gyro_comp.h", "triax_gyro_comp.c", "triax_gyro_calib.h"):
        assert " g " not in files[name].replace("2^-TRIAX_GYRO_FORCE_Q g ", "")


def test_an_image_of_the_other_triad_is_refused(built_imu: ImuBuild) -> None:
    accel, gyro = image_bytes(built_imu.accel), image_bytes(built_imu.gyro)
    assert (accel[:4], gyro[:4]) == (b"TRXC", b"TRXG")
    file, size = built_imu.files["triax_imu.bin"], len(accel) + IDENTITY_SIZE
    for half, constants in ((file[:size], accel), (file[size:], gyro)):
        assert half.startswith(constants)
        identity = identity_of(half)
        assert identity is not None
        assert identity.serial == PROVENANCE.serial


def test_a_gyro_of_another_accelerometer_does_not_compile(
    built_imu: ImuBuild, tmp_path: Path
) -> None:
    import subprocess

    for name, content in built_imu.files.items():
        (tmp_path / name).write_bytes(content)
    shape = replace(built_imu.accel.shape, output_q=23)
    other = render_routine(replace(built_imu.accel, shape=shape))
    (tmp_path / "triax_comp.h").write_text(other["triax_comp.h"])
    command = ["gcc", "-std=c99", "-fsyntax-only", str(tmp_path / "triax_imu.c")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "have different shapes" in done.stderr
