"""The delivered C of an IMU against exact physics at held-out temperatures, -40 to 85 degC, cubics.

`bench/imu_over_temperature.py` does the same with more units; its figures stand in
docs/explanation/imu-filter.md.
"""

from __future__ import annotations

import numpy as np
import pytest

from compiled_judge import Ran, delivered, judged_c
from thermal_cases import HELD_OUT, PROGRAMMES, truth_of

SEED = 11


@pytest.fixture(scope="module", params=list(PROGRAMMES))
def ran(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Ran:
    truth, programme = truth_of(SEED), PROGRAMMES[request.param]
    return delivered(tmp_path_factory.mktemp(request.param), truth, programme(truth, SEED))


@pytest.fixture
def held_out(ran: Ran) -> tuple[float, ...]:
    (degc,) = (HELD_OUT[name] for name in PROGRAMMES if name in str(ran.unit))
    return degc


def test_nothing_was_recorded_near_the_held_out_temperatures(
    ran: Ran, held_out: tuple[float, ...]
) -> None:
    assert ran.made.done.recording is not None
    temps = np.concatenate([p.temp_degc for p in ran.made.done.recording.pieces()])  # type: ignore[misc]
    # The thermometer's noise is 0.05 degC.
    assert min(np.abs(temps - degc).min() for degc in held_out) > 4.5


def test_the_c_is_off_the_truth_by_no_more_than_is_stated(
    ran: Ran, held_out: tuple[float, ...]
) -> None:
    """Force and rate in rests and in turns at up to 200 deg/s, at each held-out temperature."""
    for degc in held_out:
        found = judged_c(ran, degc)
        # At most four temperatures of 21 constants: beyond 5 sd once in 20 000.
        assert (np.abs(found.accel) < 5 * found.accel_sd + found.accel_least).all()
        assert (np.abs(found.rate) < 5 * found.rate_sd + found.rate_least).all()
        # What is stated is no wide guess: the unit itself changes by 60 mm/s^2 and 900 deg/h over
        # temperature.
        assert found.accel_sd.max() < 150e-6
        assert np.degrees(found.rate_sd[found.resting]).max() * 3600 < 10.0


def test_constants_of_one_temperature_would_be_far_off(
    ran: Ran, held_out: tuple[float, ...]
) -> None:
    """The unit itself changes by much more than the C is off."""
    at_t0 = ran.c.model.accel.constants_at(20.0), ran.c.model.gyro.constants_at(20.0)
    for degc in held_out:
        found = judged_c(ran, degc)
        biases = [
            np.abs(thermal.constants_at(degc)[9:] - fixed[9:]).max()
            for thermal, fixed in zip((ran.c.model.accel, ran.c.model.gyro), at_t0, strict=True)
        ]
        assert biases[0] > 3 * np.abs(found.accel[found.resting]).max()
        assert biases[1] > 3 * np.abs(found.rate[found.resting]).max()
