"""Temperature coefficients of both triads, from a recording of -40 to 85 degC to the compiled C."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from test_imu_delivery import DEG_PER_H, STANDARD_G, allowed, change, copied
from triaxcal.codegen.routines import GeneratedImu, start_generated_imu
from triaxcal.delivery.imu import ImuDelivery, deliver_imu
from triaxcal.delivery.imuc import ImuC
from triaxcal.dynamic.imumodel import imu_model
from triaxcal.model.methods.imu import ImuModel
from triaxcal.model.metrological import unpack_constants
from triaxcal.report.imuc import imu_c_lines
from triaxcal.simulation.imu_grades import MEMS, draw_truth
from triaxcal.simulation.unit import write_simulated_unit

EFFECTS = ("accel-temperature", "gyro-temperature")
TEMPS = (-35.0, 20.0, 30.0, 80.0)
FAR = 3
"""Of `TEMPS`: where constants that do not follow the temperature are far off."""


AT_REST = slice(20)
"""Samples without force and rate: of a gyro's scale factor 2 minutes an axis tell little."""


@dataclass(frozen=True)
class Ran:
    """A delivery, its C compiled, and samples at each temperature.

    Readings are codes times the value of a code; force and rate are true, accel and turned what
    the C makes of them: (4, 100, 3), in g and rad/s.
    """

    made: ImuDelivery
    c: ImuC
    readings: tuple[np.ndarray, np.ndarray]
    force: np.ndarray
    rate: np.ndarray
    accel: np.ndarray
    turned: np.ndarray


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Ran:
    base = tmp_path_factory.mktemp("thermal")
    unit = copied(base / "IMU-SIM", minutes="2")
    change(
        unit, "imu_truth.toml", '["delay", "g-drift"]', '["accel-temperature", "gyro-temperature"]'
    )
    change(unit, "unit.toml", '["delay", "g-drift"]', '["accelerometer-thermal", "gyro-thermal"]')
    change(unit, "unit.toml", "0.0078125", "0.125")
    write_simulated_unit(unit)
    made = deliver_imu(unit)
    assert made.c is not None
    for name, content in made.c.build.files.items():
        (base / name).write_bytes(content)
    generated = GeneratedImu(start_generated_imu(base, base).load())
    return samples(made, made.c, generated)


def samples(made: ImuDelivery, c: ImuC, generated: GeneratedImu) -> Ran:
    """What truth reads at each temperature, and what the compiled C makes of its codes."""
    rng = np.random.default_rng(5)
    shape = (len(TEMPS), 100, 3)
    force, rate = rng.uniform(-8, 8, shape), np.deg2rad(rng.uniform(-400, 400, shape))
    force[:, AT_REST] = rate[:, AT_REST] = 0.0
    truth = draw_truth(MEMS, 20240229, EFFECTS)
    warm = (np.array(TEMPS) - truth.reference_degc)[:, None, None]
    accel = force + force @ truth.accel_matrix().T
    accel += 1e-6 * np.array(truth.accel_scale_ppm_per_k) * warm * force
    accel += 1e-3 / STANDARD_G * np.array(truth.accel_bias_mm_per_s2)
    accel += 1e-3 / STANDARD_G * np.array(truth.accel_bias_mm_per_s2_per_k) * warm
    gyro = rate + rate @ truth.gyro_matrix().T
    gyro += 1e-6 * np.array(truth.gyro_scale_ppm_per_k) * warm * rate
    gyro += DEG_PER_H * np.array(truth.gyro_bias_deg_per_h)
    gyro += DEG_PER_H * np.array(truth.gyro_bias_deg_per_h_per_k) * warm
    lsb = c.device.accel_adc.volts_per_code, c.device.gyro_adc.volts_per_code
    raw = [np.rint(r / v).astype(np.int32) for r, v in zip((accel, gyro), lsb, strict=True)]
    codes = [c.device.temperature_sensor.code(t) for t in TEMPS]
    temp = np.repeat(np.array(codes, np.int32), 100)
    flat = [np.ascontiguousarray(r.reshape(-1, 3)) for r in raw]
    for image in (None, c.build.files["triax_imu.bin"]):
        _, (found, turned, status) = generated.run(image, temp, flat[0], flat[1])
        assert not status.any()
    return Ran(
        made,
        c,
        (raw[0] * lsb[0], raw[1] * lsb[1]),
        force,
        rate,
        found.reshape(shape) * 2.0**-c.device.accel_q,
        np.deg2rad(turned.reshape(shape) * 2.0**-c.device.gyro_rate_q),
    )


def exact(model: ImuModel, readings: tuple[np.ndarray, np.ndarray], i: int) -> list[np.ndarray]:
    """K(T)^-1 (U - U0(T)) of both triads at temperature i; there is no drift by force here."""
    assert not model.g_sensitivity.any()
    result = []
    for thermal, reading in zip((model.accel, model.gyro), readings, strict=True):
        K, U0 = unpack_constants(thermal.constants_at(TEMPS[i]))
        result.append(np.linalg.solve(K, (reading[i] - U0).T).T)
    return result


@pytest.mark.parametrize("i", range(len(TEMPS)))
def test_the_compiled_c_is_the_fitted_model_at_every_temperature(ran: Ran, i: int) -> None:
    found = ran.accel[i], ran.turned[i]
    expected = exact(ran.c.model, ran.readings, i)
    for f, wanted, most in zip(found, expected, allowed(ran.c), strict=True):
        assert np.abs(f - wanted).max() <= most


@pytest.mark.parametrize("i", range(len(TEMPS)))
def test_the_compiled_c_gives_the_true_force_and_rate_at_every_temperature(
    ran: Ran, i: int
) -> None:
    """Within 5 sd of the constants, half a code, and the proven bound."""
    result, device = ran.made.done.result, ran.c.device
    base = exact(ran.c.model, ran.readings, i)
    slopes = []
    for k, sd in enumerate(result.sd):
        p = result.p.copy()
        p[k] += sd
        moved = exact(imu_model(replace(result, p=p), device.range_degc), ran.readings, i)
        slopes.append([(m - b) / sd for m, b in zip(moved, base, strict=True)])
    lsb = device.accel_adc.volts_per_code, device.gyro_adc.volts_per_code
    pairs = ((ran.force[i], ran.accel[i]), (ran.rate[i], ran.turned[i]))
    for triad, (true, found) in enumerate(pairs):
        J = np.stack([s[triad] for s in slopes], axis=-1)
        sd = np.sqrt(np.einsum("nai,ij,naj->na", J, result.covariance, J))
        # |K^-1| rows sum to less than 1.1: errors of 1 %.
        most = 5 * sd + 0.55 * lsb[triad] + allowed(ran.c)[triad]
        assert (np.abs(found - true) <= most).all()


def test_constants_of_the_reference_temperature_would_be_far_off(ran: Ran) -> None:
    """At 80 degC: 2 mm/s^2/degC and 17 deg/h/degC of one axis, by 60 degC."""
    at_reference = exact(ran.c.model, tuple(r[[FAR] * 2] for r in ran.readings), 1)  # type: ignore[arg-type]
    for true, found, frozen in (
        (ran.force, ran.accel, at_reference[0]),
        (ran.rate, ran.turned, at_reference[1]),
    ):
        error = np.abs(found[FAR] - true[FAR])[AT_REST].max()
        assert np.abs(frozen - true[FAR])[AT_REST].max() > 4 * error


def test_nothing_is_said_to_be_constant(ran: Ran) -> None:
    text = "\n".join(imu_c_lines(ran.made))
    assert "-40 to 85 degC, 1 001 temperature codes" in text
    assert "constant" not in text
    assert "not corrected" not in text
    assert all(plan.shape.order >= 1 for plan in (ran.c.build.accel, ran.c.build.gyro))
    for thermal in (ran.c.model.accel, ran.c.model.gyro):
        change = thermal.constants_at(45.0) - thermal.constants_at(20.0)
        assert (np.abs(change[[0, 4, 8, 9, 10, 11]]) > 0).all()
