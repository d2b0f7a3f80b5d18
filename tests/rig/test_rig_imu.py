"""`triaxcal rig imu`: frames to a log, unit.toml and a guide, in a closed loop with an operator."""

from __future__ import annotations

import shutil
from pathlib import Path

import imu_cases
import numpy as np
import pytest
from click.testing import CliRunner, Result

import triaxcal
from guide_operator import G, Operator
from triaxcal.base.errors import RefusedError
from triaxcal.cli.main import main
from triaxcal.dynamic.description import read_dynamic
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.reading import read_recording
from triaxcal.dynamic.recording import ImuSamples, joined
from triaxcal.guide.firstnoise import with_rest
from triaxcal.guide.firstunit import Place, copy_description
from triaxcal.guide.session import GuidedRecording, at_once
from triaxcal.rig.description.shippedrigs import find_description
from triaxcal.rig.logs.logfile import read_frames

PLACE = Place(50.0, G)
LIMITS = """
[limits]
gyro_drift_sd_deg_per_h = 30
gyro_scale_sd_ppm = 150
gyro_misalignment_sd_arcsec = 45
accel_bias_sd_mm_per_s2 = 3
accel_scale_sd_ppm = 200
accel_misalignment_sd_arcsec = 60
"""


class Bus:
    """Frames of an operator's unit, whose counters go on from piece to piece."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._count = folder, 0

    def frames(self, samples: ImuSamples):
        """Of the next samples; multiples of 16 keep the counter."""
        path = self._folder / "piece.log"
        start_s = samples.time_s[0]
        text = list(imu_cases.lines(samples, start_s=start_s, first=self._count))
        self._count += len(samples)
        path.write_text("\n".join(text) + "\n", encoding="utf-8")
        for parsed in read_frames(path):
            yield parsed.frames


def run(*arguments: object) -> tuple[int, str]:
    """Exit code, and everything that was said."""
    done: Result = CliRunner().invoke(main, ["rig", "imu", *map(str, arguments)])
    assert done.exception is None or isinstance(done.exception, RefusedError)
    return done.exit_code, f"{done.output}{done.exception or ''}"


@pytest.fixture(scope="module")
def guided(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Operator, GuidedRecording]:
    """A unit without unit.toml, recorded from the first rest until the demands are met."""
    base = tmp_path_factory.mktemp("guided")
    folder, operator, bus = base / "IMU-9", Operator(1), Bus(base)
    copy_description(find_description("can-imu"), folder)
    taken = GuidedRecording(folder, PLACE, "can0", at_once)

    def give(samples: ImuSamples) -> None:
        for frames in bus.frames(samples):
            for _ in taken.feed(frames):
                pass

    taken.close()
    # What is demanded is written before the recording proper.
    with (folder / "unit.toml").open("a", encoding="utf-8") as file:
        file.write(LIMITS)
    assert not (folder / "frames.log").exists()
    taken = GuidedRecording(folder, None, "can0", at_once)
    give(operator.hold(12.0))
    for _ in range(40):
        assert taken.guide is not None
        if taken.guide.done is not None:
            break
        turn = taken.guide.advice.turn
        assert turn is not None
        if turn.angle_deg:
            give(operator.turn(np.eye(3)[turn.axis], turn.angle_deg))
        give(operator.hold(5.7))
    taken.close()
    taken.finish()
    return folder, operator, taken


def test_the_recording_is_taken_by_triaxcal_dynamic_at_once(
    guided: tuple[Path, Operator, GuidedRecording], tmp_path: Path
) -> None:
    folder, _, taken = guided
    assert taken.guide is not None
    assert taken.guide.done is not None
    done = CliRunner().invoke(main, ["dynamic", str(folder), "--build", str(tmp_path)])
    assert done.exit_code == 0, done.output
    made = triaxcal.load_imu(tmp_path / "IMU-9" / "calibration.json")
    for name, limit in (("nu0_1", 30), ("Theta11", 150), ("Theta12", 45), ("df0_1", 3)):
        assert made.states[name].sd <= limit
    # The guide's own claim is of the same recording.
    shown = {s.goal.words: s.sd for s in taken.guide.standings}
    assert made.states["nu0_1"].sd <= shown["gyro drift"] * (1 + 1e-9)


def test_it_guides_by_the_noise_of_the_first_rest(
    guided: tuple[Path, Operator, GuidedRecording],
) -> None:
    folder, _, taken = guided
    assert taken.guide is not None
    noise = taken.guide.setting.noise
    # 450 samples and three axes: a density is known to 1 / sqrt(2 * 1350) = 2 %, five of them; with
    # the rounding to 244 micro-g and 0.0156 deg/s, of variance 1/12, which adds in squares.
    for found, true, lsb in (
        (noise.gyro_arw_deg_per_sqrt_h, 0.3, 60 * imu_cases.RATE_LSB),
        (noise.accel_vrw_ug_per_sqrt_hz, 100.0, imu_cases.FORCE_LSB * 1e6),
    ):
        assert found == pytest.approx(np.sqrt(true**2 + lsb**2 / 12 / 50.0), rel=0.1)
    assert read_dynamic(folder).noise == DataSheet()  # it is found anew in each recording
    assert taken.unit.serial == "IMU-9"
    assert taken.stream.rate_hz == 50


def test_what_is_stated_is_not_measured() -> None:
    still = ImuSamples(np.arange(100) / 50.0, np.ones((100, 3)), np.ones((100, 3)))
    assert with_rest(DataSheet(0.7, 80.0), still, 50.0) == DataSheet(0.7, 80.0)
    assert with_rest(DataSheet(0.7), still, 50.0) == DataSheet(0.7, 1e-3)  # its key's least


def test_an_existing_log_becomes_a_unit(tmp_path: Path) -> None:
    operator = Operator(2)
    operator.hold(12.0)
    operator.turn([1, 0, 0], 90)
    operator.hold(7.0)
    samples = joined(operator.pieces)
    log = tmp_path / "drive.log"
    log.write_text("\n".join(imu_cases.lines(samples, bad=(20,), lost=(30,))) + "\n")
    options = ["--bus", f"replay:{log}", "--rig", "can-imu", "--latitude", 50, "--gravity", G]
    code, said = run(tmp_path / "IMU-2", *options, "--plain")
    assert code == 0, said
    count = len(samples)
    assert f"{count - 2} samples, 1 lost, 1 with a bad status" in said
    assert "turn it by" in said
    assert f"Next: triaxcal dynamic {tmp_path / 'IMU-2'}" in said
    recording = triaxcal.read_imu(tmp_path / "IMU-2")
    assert recording.serial == "IMU-2"
    assert len((tmp_path / "IMU-2" / "frames.log").read_text().splitlines()) == len(
        log.read_text().splitlines()
    )
    # A second recording does not go into the first one.
    code, said = run(tmp_path / "IMU-2", "--bus", f"replay:{log}")
    assert code == 1
    assert "frames.log: is there already; expected a new recording" in said


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--bus", "can0"], "unit.toml: no such file; expected --rig, from which it is written"),
        (["--bus", "virtual", "--rig", "can-imu", "--latitude", "50", "--gravity", "9.81"],
         "--bus virtual: simulates no IMU"),
        (["--bus", "replay:x", "--rig", "tilter", "--latitude", "50", "--gravity", "9.81"],
         "../../tilter.dbc does not lie beside it"),
        (["--bus", "replay:x", "--rig", "automotive-imu", "--latitude", "50", "--gravity", "9.81"],
         "no gyros; expected gyro_x, gyro_y and gyro_z"),
        (["--bus", "replay:x", "--rig", "can-imu", "--latitude", "50", "--gravity", "9.81"],
         "x: cannot be read: no such file"),
    ],
)  # fmt: skip
def test_what_cannot_be_recorded_is_refused(
    tmp_path: Path, arguments: list[str], text: str
) -> None:
    code, said = run(tmp_path / "U", *arguments)
    assert code == 1
    assert text in said
    assert not (tmp_path / "U").exists()  # the next try finds nothing in its way


def test_a_name_that_is_no_serial_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    options = ["--bus", "replay:x", "--rig", "can-imu", "--latitude", 50, "--gravity", G]
    code, said = run(tmp_path / "my unit", *options)
    assert code == 1
    assert "unit name: found 'my unit'" in said
    assert not (tmp_path / "my unit").exists()


def test_options_of_a_first_unit_and_a_unit_that_is_there(tmp_path: Path) -> None:
    folder = imu_cases.write_unit(tmp_path / "U", Operator(3).hold(1.0))
    (folder / "frames.log").unlink()
    code, said = run(folder, "--bus", "replay:x", "--latitude", "50")
    assert code == 1
    assert f"--latitude: given, and {folder / 'unit.toml'} is there" in said
    text = (folder / "unit.toml").read_text(encoding="utf-8")
    (folder / "unit.toml").write_text(text.replace('rig = "rig.toml"\n', ""), encoding="utf-8")
    with pytest.raises(RefusedError, match="names no rig description"):
        GuidedRecording(folder, None, "can0", at_once)


def test_a_log_of_another_rig_is_refused_and_one_without_a_rest_is_kept(tmp_path: Path) -> None:
    operator = Operator(4)
    for _ in range(4):
        operator.turn([0, 0, 1], 360)
    log = tmp_path / "drive.log"
    options = ["--rig", "can-imu", "--latitude", 50, "--gravity", G, "--plain"]
    log.write_text("(1700000000.000000) can0 123#0011\n")
    code, said = run(tmp_path / "A", "--bus", f"replay:{log}", *options)
    assert code == 1
    assert "frames.log: no sample of" in said
    assert not (tmp_path / "A" / "frames.log").exists()
    log.write_text("\n".join(imu_cases.lines(joined(operator.pieces))) + "\n")
    code, said = run(tmp_path / "B", "--bus", f"replay:{log}", *options)
    assert code == 0
    assert "put it down, any side up; hold it still for 10 s" in said
    assert (tmp_path / "B" / "frames.log").stat().st_size > 0


def test_white_noise_of_quantised_drifting_readings() -> None:
    """A slow drift is no noise: changes between samples do not see it."""
    rng = np.random.default_rng(1)
    drift = np.linspace(0, 1e-3, 5000)[:, None]
    rate = rng.normal(0, 2e-4, (5000, 3)) + drift
    force = rng.normal(0, 5e-3, (5000, 3)) + 100 * drift
    samples = ImuSamples(np.arange(5000) / 100.0, rate, force)
    found = with_rest(DataSheet(), samples, 100.0)
    assert found.gyro_arw_deg_per_sqrt_h is not None
    assert found.accel_vrw_ug_per_sqrt_hz is not None
    assert np.radians(found.gyro_arw_deg_per_sqrt_h) / 60 == pytest.approx(2e-5, rel=0.05)
    assert found.accel_vrw_ug_per_sqrt_hz * 9.80665e-6 == pytest.approx(5e-4, rel=0.05)


def test_a_description_is_copied_with_its_bus_files(tmp_path: Path) -> None:
    source = tmp_path / "mine"
    shutil.copytree(imu_cases.FOLDER, source)
    copy_description(source / "rig.toml", tmp_path / "U")
    assert sorted(p.name for p in (tmp_path / "U").iterdir()) == ["imu.dbc", "rig.toml"]


def test_units_in_one_log_become_a_folder_each(tmp_path: Path) -> None:
    """On channels of their own, turned together: the same table, each with its own readings."""
    one, two = Operator(5), Operator(6)
    text: list[tuple[str, str]] = []
    for channel, operator in (("can0", one), ("can1", two)):
        operator.hold(12.0)
        operator.turn([1, 0, 0], 90)
        operator.hold(6.0)
        found = imu_cases.lines(joined(operator.pieces), channel=channel, late_ns=300_000)
        text += [(line.split()[0], line) for line in found]
    log = tmp_path / "both.log"
    log.write_text("\n".join(line for _, line in sorted(text)) + "\n", encoding="utf-8")
    for channel, operator in (("can0", one), ("can1", two)):
        rig = tmp_path / channel
        shutil.copytree(imu_cases.FOLDER, rig)
        words = (rig / "rig.toml").read_text(encoding="utf-8")
        words = words.replace('file = "imu.dbc"', f'file = "imu.dbc"\nchannel = "{channel}"')
        (rig / "rig.toml").write_text(words, encoding="utf-8")
        options = ["--rig", rig / "rig.toml", "--latitude", 50, "--gravity", G, "--plain"]
        code, said = run(tmp_path / f"U-{channel}", "--bus", f"replay:{log}", *options)
        assert code == 0, said
        found_samples = read_recording(read_dynamic(tmp_path / f"U-{channel}")).all()
        sent = joined(operator.pieces)
        force, _ = imu_cases.codes_of(sent)
        # The first temperature comes before the first sample and belongs to none: 50 samples wait.
        assert len(found_samples) == len(sent) - 50
        lsb = imu_cases.FORCE_LSB * imu_cases.G
        np.testing.assert_allclose(found_samples.force, force[50:] * lsb, rtol=1e-13)
