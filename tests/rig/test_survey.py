"""`triaxcal rig signals` finds the axes of a log; `triaxcal init --rig` writes a description."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from any_rig_cases import any_rig, any_setup
from click.testing import CliRunner

from recordings import recording
from triaxcal.base.errors import RefusedError, UsageError
from triaxcal.cli.main import main
from triaxcal.rig.bus.frames import Frames, concatenate
from triaxcal.rig.description.busfile import read_bus_file
from triaxcal.rig.description.rigfile import read_description
from triaxcal.rig.description.shippedrigs import descriptions_folder
from triaxcal.rig.description.survey import survey
from triaxcal.rig.logs.candump import format_frames
from triaxcal.rig.logs.logfile import read_frames

IMU = descriptions_folder() / "automotive-imu" / "imu.dbc"
FLOAT = descriptions_folder() / "canopen-float" / "accelerometer.dbc"


def turned(setup, positions=("TP1", "TP2", "TP5"), seconds=8):
    """Frames of a rig at rest in some positions; what it sends while it turns is among them."""
    rig, parts = any_rig(setup), []
    for position in positions:
        rig.turn_to(position)
        parts += [rig.advance() for _ in range(4 + seconds)]
    return concatenate(parts)


def test_the_axes_of_a_car_s_sensor_are_found(tmp_path):
    setup = any_setup(tmp_path, "automotive-imu")
    found = survey(read_bus_file(IMU).layouts(), [turned(setup)])
    assert set(found.triads[0].labels) == {"IMU_AX.AX", "IMU_AY.AY", "IMU_AZ.AZ"}
    assert found.triads[0].norm == pytest.approx(1.0, abs=0.01)
    assert found.triads[0].turned_deg == pytest.approx(90.0, abs=1.0)
    names = ("IMU_AX", "IMU_AY", "IMU_AZ")
    assert sorted(found.counters) == [f"{name}.Counter counts" for name in names]
    said = [f'{name}.Crc is a CRC, protection = "sae-j1850"' for name in names]
    assert sorted(found.crcs) == said


def test_axes_without_a_unit_are_found_when_the_log_turns(tmp_path):
    setup = any_setup(tmp_path, "automotive-imu")
    path = tmp_path / "bare.dbc"
    path.write_text(
        IMU.read_text().replace('"g"', '""').replace("(0.0001220703125,-4)", "(1,-32768)")
    )
    layouts = list(read_bus_file(path).layouts())
    found = survey(layouts, [turned(setup)])
    assert set(found.triads[0].labels) == {"IMU_AX.AX", "IMU_AY.AY", "IMU_AZ.AZ"}
    assert found.triads[0].tells
    still = survey(layouts, [turned(setup, ("TP1",))])
    assert not any(triad.tells for triad in still.triads)


def test_counters_and_statuses_that_stand_still_are_told(tmp_path):
    setup = any_setup(tmp_path, "automotive-imu")
    frames = turned(setup, ("TP1",))
    data = frames.data.copy()
    data[:, 6] = 0x53  # counter 3, status 5
    frames = Frames(frames.t_ns, frames.can_id, frames.length, frames.fd, data)
    found = survey(read_bus_file(IMU).layouts(), [frames])
    assert "IMU_AX.Counter never counts: it is 3 in every frame" in found.counters
    assert "IMU_AX.Status never clears: it is 5 in every frame" in found.statuses
    assert found.crcs == ()


def test_a_wrong_bus_description_is_seen_by_its_g(tmp_path):
    setup = any_setup(tmp_path, "automotive-imu")
    path, log = tmp_path / "wrong.dbc", tmp_path / "frames.log"
    path.write_text(IMU.read_text().replace("(0.0001220703125,-4)", "(0.00005,-1.6384)"))
    log.write_bytes(format_frames(turned(setup), "can0"))
    done = CliRunner().invoke(main, ["rig", "signals", str(log), str(path)])
    assert done.exit_code == 0, done.output
    assert "|a| = 0.4098 g at rest" in done.output
    assert "not g, is this the right bus description?" in done.output


def test_frames_of_another_length_are_said(tmp_path):
    """Those of one message lack a byte; those of the others are as described."""
    frames = turned(any_setup(tmp_path, "automotive-imu"), ("TP1",), seconds=1)
    layouts = {layout.name: layout for layout in read_bus_file(IMU).layouts()}
    mine = layouts["IMU_AX"].mine(frames.can_id)
    shorter = replace(frames, length=np.where(mine, 7, frames.length).astype(np.uint8))
    found = survey(layouts.values(), [shorter])
    assert "IMU_AX" not in found.frames
    assert found.misfits == (
        (
            f"IMU_AX: {int(mine.sum())} frames have another length or kind than the 8 bytes of "
            "classic CAN described"
        ),
    )


def test_frames_of_another_bus_are_refused(tmp_path):
    log = tmp_path / "frames.log"
    log.write_bytes(format_frames(turned(any_setup(tmp_path, "tilter"), ("TP1",)), "can0"))
    done = CliRunner().invoke(main, ["rig", "signals", str(log), str(IMU)])
    assert done.exit_code == 1
    assert f"no frame of a message of {IMU}" in str(done.exception)


def test_the_imu_of_a_real_log_is_found_among_nine_messages():
    folder = recording("css_canedge")
    layouts = list(read_bus_file(folder / "canmod-gps.dbc").layouts())
    assert len(layouts) == 9
    parts = [p.frames for p in read_frames(next(folder.glob("*.log")))]
    found = survey(layouts, parts)
    assert found.triads[0].labels == tuple(f"gnss_imu.Acceleration{a}" for a in "XYZ")
    # |(-0.4992, -0.1973, 10.5012)| m/s^2 of the published means.
    assert found.triads[0].norm == pytest.approx(10.5149 / 9.80665, abs=1e-4)
    assert "gnss_attitude.AttitudeValid never becomes valid: it is 0 in every frame" in (
        found.statuses
    )


# ---- init --rig ----


def init(folder, *options, typed=None):
    return CliRunner().invoke(main, ["init", str(folder), "--rig", *map(str, options)], input=typed)


def test_a_description_is_written_and_read(tmp_path):
    axes = ("--x", "TPDO1.AccX", "--y", "TPDO1.AccY", "--z", "TPDO2.AccZ")
    done = init(tmp_path / "mine", FLOAT, *axes, "--temperature", "TPDO2.Temperature")
    assert done.exit_code == 0, done.output
    rig = read_description(tmp_path / "mine" / "rig.toml")
    assert [axis.label for axis in rig.axes] == ["TPDO1.AccX", "TPDO1.AccY", "TPDO2.AccZ"]
    assert (rig.join, rig.temperature.label) == ("age", "TPDO2.Temperature")
    again = init(tmp_path / "mine", FLOAT, *axes)
    assert again.exit_code == 1
    assert "exists already" in str(again.exception)


def test_guesses_stand_there_as_comments(tmp_path):
    axes = ("--x", "IMU_AX.AX", "--y", "IMU_AY.AY", "--z", "IMU_AZ.AZ")
    assert init(tmp_path, IMU, *axes).exit_code == 0
    text = (tmp_path / "rig.toml").read_text()
    for line in ('# counter = "Counter"', '# crc = "Crc"'):
        assert text.count(line) == 3
    assert text.count('# status = "Status"') == 2
    assert text.count('# status = ["ClusterStatus", "Status"]') == 1
    assert "temperature" not in text
    uncommented = text.replace("# counter", "counter").replace('join = "age"\n', "")
    uncommented = uncommented.replace('# join = "counter"', 'join = "counter"')
    lines = [line for line in uncommented.splitlines() if not line.startswith("age_s")]
    (tmp_path / "rig.toml").write_text("\n".join(lines))
    assert read_description(tmp_path / "rig.toml").join == "counter"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--x", "IMU_AX.Ax"), "--x: no signal 'IMU_AX.Ax'"),
        (("--x", "IMU_AX.Ax"), "nearest: IMU_AX.AX"),
        (("--x", "IMU_AX.AX"), "--y: missing; expected a signal of"),
        (("--x", "IMU_AX.AX"), "as IMU_AY.AY"),
        (
            ("--x", "IMU_AX.AX", "--y", "IMU_AX.AX", "--z", "IMU_AZ.AZ"),
            "rig.toml, [signals] y: IMU_AX.AX is x already",
        ),
    ],
)
def test_a_description_that_cannot_be_is_not_written(tmp_path, options, said):
    done = init(tmp_path / "mine", IMU, *options)
    assert done.exit_code == 1
    assert isinstance(done.exception, RefusedError)
    assert said in str(done.exception)
    assert list((tmp_path / "mine").glob("*")) == []


def test_at_a_terminal_it_asks_again_with_the_nearest_names(tmp_path, monkeypatch):
    monkeypatch.setattr("triaxcal.cli.init.at_a_terminal", lambda: True)
    typed = "IMU_AX.A\nIMU_AX.AX\n\n\nIMU_AY.Temperature\n"
    done = init(tmp_path, IMU, typed=typed)
    assert done.exit_code == 0, done.output
    assert "no signal IMU_AX.A; nearest: IMU_AX.AX" in done.output
    rig = read_description(tmp_path / "rig.toml")
    assert [axis.label for axis in rig.axes] == ["IMU_AX.AX", "IMU_AY.AY", "IMU_AZ.AZ"]
    assert rig.temperature.label == "IMU_AY.Temperature"


def test_signals_without_rig_are_a_mistyped_command(tmp_path):
    done = CliRunner().invoke(main, ["init", str(tmp_path / "u"), "--x", "A.B"])
    assert isinstance(done.exception, UsageError)
    assert "--x: given without --rig" in str(done.exception)
    assert not (tmp_path / "u").exists()
