"""An IMU whose gyros have a thermometer of their own: constants, C, files, what is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import triaxcal
from compiled_judge import DEVICE, Ran, delivered, folder_of, judged_c
from dynamic_cases import held
from thermal_cases import POINTS, RATE_HZ, TURNS, apart_at_point, own_degc, true_at, truth_of
from triaxcal.base.errors import RefusedError
from triaxcal.delivery.imu import deliver_imu
from triaxcal.dynamic.blocks.base import GYRO_BIAS, GYRO_MATRIX
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.report.dynamic import dynamic_files, dynamic_summary
from triaxcal.simulation.imu import simulate_imu
from triaxcal.simulation.imu_grades import MEMS, draw_truth
from triaxcal.simulation.imu_motion import ImuMotion, Mounting
from triaxcal.simulation.imu_temperature import TemperatureDrift, TemperatureRamp
from triaxcal.simulation.imu_truth import ImuTruth

OWN = """\
gyro_degc_per_code = 0.25
gyro_degc_at_zero = 25
gyro_range_degc = [-34.5, 95]
"""


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Ran:
    truth = truth_of(5)
    points = [apart_at_point(truth, t, 500 + k) for k, t in enumerate(POINTS)]
    return delivered(tmp_path_factory.mktemp("apart"), truth, points, DEVICE + OWN)


def test_the_constants_of_each_triad_are_functions_of_its_own_temperature(ran: Ran) -> None:
    over = ran.made.done.over
    assert over is not None
    known = over.known
    apart = known.gyro_temps_degc - known.temps_degc
    assert apart.min() > 1.0
    accel, gyro = (true_at(ran.truth, t) for t in (known.temps_degc, known.gyro_temps_degc))
    z = (known.value - np.concatenate([accel[:, :9], gyro[:, 9:]], axis=1)) / known.sd
    # 21 constants at four independent temperatures: beyond 4.5 once in 1800.
    assert np.abs(z).max() < 4.5
    # By the other thermometer the gyros' biases would be far off.
    wrong = (known.value - accel)[:, 9:12] / known.sd[:, 9:12]
    assert np.abs(wrong).max() > 20


@pytest.mark.parametrize("degc", [-25.0, 35.0, 70.0])
@pytest.mark.parametrize("colder_k", [0.0, 12.0])
def test_the_c_takes_the_code_of_each_thermometer(ran: Ran, degc: float, colder_k: float) -> None:
    """Also where the two differ by something else than in the recordings."""
    found = judged_c(ran, degc, own_degc(degc) - colder_k)
    # Codes of 0.25 degC: 0.125/60 of 900 deg/h a coefficient, of three.
    rounding = np.deg2rad(3 * 0.125 / 60 * 900 / 3600)
    assert (np.abs(found.accel) < 5 * found.accel_sd + found.accel_least).all()
    assert (np.abs(found.rate) < 5 * found.rate_sd + found.rate_least + rounding).all()


def test_one_code_for_both_would_be_wrong(ran: Ran) -> None:
    c = ran.c
    sensor, raw = c.device.gyro_temperature_sensor, np.zeros((1, 3), np.int32)
    temp = np.array([c.device.temperature_sensor.code(35.0)], np.int32)
    rates = [
        ran.generated.run(None, temp, raw, raw, np.array([sensor.code(t)], np.int32))[1][1]
        for t in (own_degc(35.0), 35.0)
    ]
    assert np.abs(rates[0] - rates[1]).max() * 2.0**-c.device.gyro_rate_q * 3600 > 50


def test_header_and_status_have_both_codes(ran: Ran) -> None:
    header = ran.c.build.files["triax_imu.h"].decode()
    assert "int32_t accel_temp_code, int32_t gyro_temp_code);" in header
    assert "#define TRIAX_IMU_TWO_THERMOMETERS" in header
    # The gyros' code is beyond the range of their thermometer, the accelerometers' is not.
    raw, sensor = np.zeros((1, 3), np.int32), ran.c.device.gyro_temperature_sensor
    temp = np.array([ran.c.device.temperature_sensor.code(80.0)], np.int32)
    hot = np.array([sensor.code(100.0)], np.int32)
    _, (_, _, status) = ran.generated.run(None, temp, raw, raw, hot)
    assert status[0] & 255 == 0
    assert status[0] // 256 != 0


def test_files_and_python_have_both_temperatures(ran: Ran) -> None:
    files = dynamic_files(ran.made)
    document = json.loads(files["calibration.json"])
    assert document["range_degc"] == [-40.0, 85.0]
    assert document["gyro_range_degc"] == [-34.5, 95.0]
    over = document["over_temperature"]
    assert over["gyro_temps_degc"][-1] == pytest.approx(own_degc(85.0), abs=0.2)
    assert over["gyro_reference_degc"] == pytest.approx(own_degc(20.0), abs=0.5)
    assert json.loads(files["verification.json"])["gyro_range_degc"] == [-34.5, 95.0]
    path = ran.unit / "calibration.json"
    path.write_bytes(files["calibration.json"])
    cal = triaxcal.load_imu(path)
    model = ran.c.model
    found = cal.constants(35.0, own_degc(35.0))
    assert np.allclose(found.gyro_bias_rad_per_s, model.gyro.constants_at(own_degc(35.0))[9:])
    assert np.allclose(found.accel_matrix.ravel(), model.accel.constants_at(35.0)[:9])
    with pytest.raises(RefusedError, match=r"gyro_temp_degc: not given"):
        cal.constants(35.0)
    assert cal.c.build.files.keys() == ran.c.build.files.keys()
    firmware = triaxcal.firmware_imu(cal)
    raw = np.zeros((1, 3), np.int32)
    with pytest.raises(RefusedError, match=r"gyro_temp_codes: not given"):
        firmware.apply(raw, raw, 280)
    accel, rate, status = firmware.apply(raw, raw, [280], [72])
    _, answers = ran.generated.run(
        None, np.array([280], np.int32), raw, raw, np.array([72], np.int32)
    )
    for expected, got in zip(answers, (accel, rate, status), strict=True):
        assert (expected == got).all()


def test_summary_and_page_name_both_temperatures(ran: Ran) -> None:
    text = dynamic_summary(ran.made, ["a"], "build")
    assert "constants above at 20 degC, gyros at 27." in text
    assert "gyro by its own thermometer: -34.5 to 95 degC, 519 temperature codes" in text
    assert "over temperature: [dynamic] blocks has no" not in text  # the curves follow it
    page = dynamic_files(ran.made)["dynamic.html"].decode()
    assert "−40 to 85 °C; gyros −34.5 to 95 °C" in page
    assert "those of the gyros at 27." in page
    header = ran.c.build.files["triax_gyro_calib.h"].decode()
    assert "the gyro has a thermometer of its own: -34.5 to 95 degC by it" in header


def test_each_group_is_seen_at_the_temperatures_of_its_triad(ran: Ran) -> None:
    over = ran.made.done.over
    assert over is not None
    assert over.nodes.t0_degc == 20.0
    assert over.gyro_nodes.degc == pytest.approx([own_degc(t) for t in POINTS], abs=0.6)
    for name in (GYRO_BIAS.name, GYRO_MATRIX.name):
        assert over.choice.fit.shapes[name].label == "polynomial of order 3"


def refusal(base: Path, device: str, change: tuple[str, str] = ("", "")) -> str:
    truth = truth_of(5)
    points = [apart_at_point(truth, t, 500 + k) for k, t in enumerate((20.0, 50.0))]
    unit = folder_of(base, points, device)
    path = unit / "unit.toml"
    path.write_text(path.read_text().replace(*change) if change[0] else path.read_text())
    with pytest.raises(RefusedError) as refused:
        deliver_imu(unit)
    return str(refused.value).replace(str(unit), "IMU")


def test_a_range_beyond_what_the_gyros_thermometer_read_is_refused(tmp_path: Path) -> None:
    device = DEVICE.replace("[-40, 85]", "[19, 50]") + OWN
    text = refusal(tmp_path, device)
    assert text.startswith("IMU/unit.toml, [device] gyro_range_degc: -34.5 to 95 degC, and the ")


@pytest.mark.parametrize(
    ("device", "change", "message"),
    [
        (
            DEVICE + OWN,
            ('gyro_temp_column = "gyro_temp_degc"\n', ""),
            "IMU/unit.toml, [device] gyro_degc_per_code: given, and no [dynamic] gyro_temp_col",
        ),
        (
            DEVICE + OWN,
            (OWN, ""),
            "IMU/unit.toml, [dynamic] gyro_temp_column: given, and no [device] gyro_degc_per_",
        ),
        (
            DEVICE + OWN,
            ("gyro_degc_per_code = 0.25\n", ""),
            "IMU/unit.toml, [device] gyro_degc_at_zero: given, and no gyro_degc_per_code; ",
        ),
        (
            DEVICE + OWN,
            ('\ntemp_column = "temp_degc"', ""),
            "IMU/unit.toml, [dynamic] gyro_temp_column: given, and no temp_column; ",
        ),
    ],
)
def test_keys_of_one_thermometer_without_the_other_are_refused(
    tmp_path: Path, device: str, change: tuple[str, str], message: str
) -> None:
    assert refusal(tmp_path, device, change).startswith(message)


def test_thermometers_that_do_not_rise_together_are_refused(tmp_path: Path) -> None:
    truth = truth_of(5)
    points = [apart_at_point(truth, t, 500 + k) for k, t in enumerate((20.0, 50.0))]
    unit = folder_of(tmp_path, points, DEVICE.replace("[-40, 85]", "[19, 50]") + OWN)
    for name in ("recording.csv", "1.csv"):
        path = unit / name
        table = np.loadtxt(path, delimiter=",", skiprows=1)
        header = path.read_text().split("\n", 1)[0]
        table[:, 8] = 30.0 + 0.01 * np.sin(table[:, 0])
        np.savetxt(path, table, fmt="%.12g", delimiter=",", header=header, comments="")
    toml = (unit / "unit.toml").read_text().replace("[-34.5, 95]", "[30, 30.1]")
    (unit / "unit.toml").write_text(toml)
    with pytest.raises(RefusedError, match="expected two thermometers that rise together"):
        deliver_imu(unit)


def apart_ramp(
    truth: ImuTruth, ends_degc: tuple[float, float], seed: int, turns: bool = True
) -> ImuRecording:
    """From one temperature to another; the gyros are warmer, and change later."""
    mountings = tuple(Mounting(TURNS, 12.0) for _ in range(3))
    plan = ImuMotion(mountings if turns else (Mounting((), 400.0),))
    low, high = ends_degc
    lag = TemperatureDrift(own_degc(low), own_degc(high), plan.duration_s / 4)
    steady = TemperatureRamp(low, high, plan.duration_s)
    motion = replace(plan, temperature=steady, gyro_temperature=lag)
    return held(simulate_imu(truth, motion, RATE_HZ, seed))


def test_a_soak_has_the_temperature_of_each_triad(tmp_path: Path) -> None:
    truth = truth_of(4)
    turned = apart_at_point(truth, 20.0, 1)
    unit = folder_of(tmp_path, [turned, apart_ramp(truth, (20.0, 60.0), 2, turns=False)], "# own")
    path = unit / "unit.toml"
    text = path.read_text().replace("# own", "")
    column = 'temp_column = "temp_degc"\n'
    path.write_text(text.replace(column, column + 'gyro_temp_column = "gyro_temp_degc"\n'))
    over = deliver_imu(unit).done.over
    assert over is not None
    known = over.known
    assert known.gyro_temps_degc[-1] > known.temps_degc[-1] + 6.0
    drift = true_at(truth, known.gyro_temps_degc)[:, 9:12]
    z = (known.value[:, 9:12] - drift) / known.sd[:, 9:12]
    assert np.abs(z).max() < 4.5
    # By the accelerometers' thermometer the same biases would be off.
    wrong = true_at(truth, known.temps_degc)[:, 9:12]
    assert np.abs((known.value[:, 9:12] - wrong) / known.sd[:, 9:12]).max() > 10


def test_linear_coefficients_are_of_the_temperature_of_each_triad(tmp_path: Path) -> None:
    """A single recording with the blocks of linear coefficients, to the codes of the C."""
    truth = draw_truth(MEMS, 5, ("accel-temperature", "gyro-temperature"))
    recording = apart_ramp(truth, (15.0, 45.0), 3)
    own = "gyro_degc_per_code = 0.125\ngyro_range_degc = [24, 53]\n"
    unit = folder_of(tmp_path, [recording], DEVICE.replace("[-40, 85]", "[15, 45]") + own)
    path = unit / "unit.toml"
    blocks = 'blocks = ["accelerometer-thermal", "gyro-thermal"]\n'
    path.write_text(path.read_text().replace("temp_column", blocks + "temp_column", 1))
    made = deliver_imu(unit)
    assert made.c is not None
    gyro = made.c.model.gyro
    assert made.c.build.gyro.temp_max_code == 424
    result = made.done.result
    place = result.layout.place("gyro-thermal")
    slope = np.radians(np.array(truth.gyro_bias_deg_per_h_per_k)) / 3600
    z = (result.p[place][:3] - slope) / result.sd[place][:3]
    assert np.abs(z).max() < 4.5
    change = gyro.constants_at(50.0)[9:] - gyro.constants_at(30.0)[9:]
    assert change == pytest.approx(20.0 * result.p[place][:3])
