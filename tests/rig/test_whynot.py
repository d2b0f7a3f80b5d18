"""Logs and buses that do not fit their description: which of it is said, and in whose counts."""

from __future__ import annotations

import can
import cantools
import numpy as np
import pytest
from click.testing import CliRunner

from triaxcal.cli.rig import rig as command
from triaxcal.rig.bus.messages import frames_of
from triaxcal.rig.check.census import Census
from triaxcal.rig.description.rigfile import read_description
from triaxcal.rig.logs.candump import format_frames

DBC = """VERSION ""
BS_:
BU_: N
BO_ 256 Imu: 8 N
 SG_ Ax : 0|16@1- (0.0001,0) [0|0] "g" N
 SG_ Ay : 16|16@1- (0.0001,0) [0|0] "g" N
 SG_ Az : 32|16@1- (0.0001,0) [0|0] "g" N
 SG_ Count : 48|4@1+ (1,0) [0|0] "" N
 SG_ State : 52|4@1+ (1,0) [0|0] "" N
 SG_ Temp : 56|8@1- (1,0) [0|0] "degC" N
"""
RIG = """format = 1
[rig]
file = "bus.dbc"
[signals]
x = "Imu.Ax"
y = "Imu.Ay"
z = "Imu.Az"
temperature = "Imu.Temp"
[message.Imu]
counter = "Count"
status = "State"
"""
PLAN = """format = 1
[rig]
rate_hz = 50
rig = "rig.toml"
[steps]
temperatures_degc = [20]
take_out_of_order = true
"""
SHORT = """
[stillness]
reference_s = 60
settle_s = 2
average_s = 20
guard_s = 2
batches = 10
u_max_micro_g = 1000
moving_step_micro_g = 20000
[thermal]
window_s = 30
tolerance_k = 2
slope_max_k_per_min = 5
span_max_k = 3
"""
UNIT = """format = 1
serial = "W-1"
[adc]
bits = 16
full_scale_v = 8
[temperature_sensor]
degc_per_code = 1
[site]
local_gravity_m_per_s2 = 9.8111
[thermal]
t0_degc = 20
range_degc = [15, 25]
"""


def sent(seconds=10, *, modulus=16, counts=True, noise=3, state=0, swapped=False, size=8, **kind):
    """Messages of a unit at rest, z up; the counter, the state and the frame as told."""
    database = cantools.database.load_string(DBC, "dbc")
    rng = np.random.default_rng(3)
    messages = []
    for i in range(50 * seconds):
        x, y, z = np.rint(rng.normal((50, -70, 10000), noise)) / 10000
        values = {"Ax": x, "Ay": y, "Az": z, "Count": i % modulus if counts else 5,
                  "State": state, "Temp": 20}  # fmt: skip
        data = bytearray(database.encode_message("Imu", values))
        if swapped:
            data[0:6] = data[1::-1] + data[3:1:-1] + data[5:3:-1]
        data = bytes(data[:size]) + bytes(max(0, size - 8))
        options = {"arbitration_id": 0x100, "is_extended_id": False, **kind}
        messages.append(can.Message(timestamp=1.7e9 + i / 50, data=data, **options))
    return messages


@pytest.fixture
def folder(tmp_path):
    unit = tmp_path / "W-1"
    unit.mkdir()
    (unit / "unit.toml").write_text(UNIT)
    (tmp_path / "plan.toml").write_text(PLAN)
    (tmp_path / "rig.toml").write_text(RIG)
    (tmp_path / "bus.dbc").write_text(DBC)
    return tmp_path


def called(folder, messages, *words):
    """What the command line says of a log of these messages."""
    (folder / "x.log").write_bytes(format_frames(frames_of(messages), "can0"))
    name = {"replay": (str(folder / "x.log"),), "check": ("--bus", f"replay:{folder}/x.log")}
    common = ("--unit", str(folder / "W-1"), "--plan", str(folder / "plan.toml"))
    return CliRunner().invoke(command, [words[0], *common, *words[1:], *name[words[0]]])


CASES = [
    ({"counts": False}, "Count never counts, it is always 5"),
    ({"modulus": 15}, "Count counts from 0 to 14, and 0 to 15 is described: counter_modulus = 15"),
    ({"size": 7}, "Imu (ID 0x100): 500 of 500 frames have 7 bytes of classic CAN, not 8 bytes"),
    (
        {"size": 12, "is_fd": True},
        "500 of 500 frames have 12 bytes of CAN FD, not 8 bytes of classic CAN as described",
    ),
    ({"is_fd": True}, "500 of 500 frames have 8 bytes of CAN FD, not 8 bytes of classic CAN"),
    ({"arbitration_id": 0x101}, "no frame; other IDs that came, the nearest first: 0x101 (500)"),
    ({"is_extended_id": True}, "no frame; 500 have this number as an ID of 29 bits"),
    ({"state": 3}, "500 of 500 frames have a status that is not good (0x3 beside it)"),
    ({"swapped": True}, "jump from sample to sample; is the byte order"),
    ({"noise": 0}, "x, y, z always the same code, a stuck axis or another signal"),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "said"), CASES)
def test_replay_says_why_a_log_holds_no_session(folder, changes, said):
    done = called(folder, sent(**changes), "replay")
    text = str(done.exception)
    assert "holds 0 accepted dwells of the plan's 6" in text
    assert said in text
    assert said in done.output
    assert "resume" not in text
    assert "note: no serial number" in done.output
    assert "Imu (ID 0x100): " in done.output


@pytest.mark.parametrize(("changes", "said"), CASES)
def test_check_names_the_likely_cause(folder, changes, said):
    done = called(folder, sent(**changes), "check", "--seconds", "600")
    assert said in "\n".join(row for row in done.output.splitlines() if row.startswith("WRONG"))


def test_a_fault_of_the_description_is_no_fault_of_a_good_bus(folder):
    (folder / "x.log").write_bytes(format_frames(frames_of(sent()), "can0"))
    census = Census(read_description(folder / "rig.toml"))
    census.add(frames_of(sent(4)))
    census.add(frames_of(sent(4)[8:]))
    assert census.faults() == []
    assert census.said() == ["Imu (ID 0x100): 392 frames, 392 good"]


@pytest.mark.parametrize("seconds", [3, 60])
def test_check_judges_the_first_seconds_of_a_log(folder, seconds):
    messages = sent(seconds)
    if seconds == 60:  # from 10 s on it lies on another side
        for message, other in zip(messages[500:], sent(60, noise=4)[500:], strict=True):
            message.data[:] = other.data[2:6] + other.data[:2] + other.data[6:]
    done = called(folder, messages, "check")
    assert done.exit_code == 0, done.output
    judged = min(seconds - 0.02, 5.0)
    assert f"judged: {judged:.1f} s from 2023-11-14 22:13:20 UTC" in done.output
    assert "position TP1 (+Z up)" in done.output


def test_a_folder_that_is_not_there_is_said_before_anything_is_read(folder):
    done = called(folder, sent(1), "replay", "--into", str(folder / "none"))
    assert str(done.exception).startswith(f"{folder / 'none'}: no such folder")
    assert "dwells" not in str(done.exception)


def test_j1939_source_addresses_that_came_are_named(folder):
    (folder / "bus.dbc").write_text(DBC.replace("BO_ 256", f"BO_ {0x98FF0080}"))
    (folder / "rig.toml").write_text(RIG + "j1939 = true\n")
    census = Census(read_description(folder / "rig.toml"))
    census.add(frames_of(sent(1, arbitration_id=0x0CFF0081, is_extended_id=True)))
    (said,) = census.faults()
    assert "no frame from source address 0x80; its PGN comes from 0x81" in said


def test_frames_of_another_channel_than_that_of_the_rig_are_named(folder):
    text = RIG.replace('file = "bus.dbc"', 'file = "bus.dbc"\nchannel = "can1"')
    (folder / "rig.toml").write_text(text)
    said = str(called(folder, sent(1), "replay").exception)
    assert "channel can1 of rig.toml is read; frames came on can0 (50)" in said


def test_a_table_of_which_no_line_is_a_frame_is_said_to_hold_none(folder):
    (folder / "x.csv").write_text("time_s,id,length,fd,payload\n1,0xZZ,8,0,00\n")
    common = ("--unit", str(folder / "W-1"), "--plan", str(folder / "plan.toml"))
    done = CliRunner().invoke(command, ["replay", *common, str(folder / "x.csv")])
    assert "no frames in it; its first line is '1,0xZZ,8,0,00" in str(done.exception)


def test_dwells_that_were_tried_are_counted_with_their_reasons(folder):
    """A log that ends in the first dwell, after a shock while it averages."""
    (folder / "plan.toml").write_text(PLAN + SHORT)
    messages = sent(82)
    for message in messages[50 * 76 : 50 * 77]:
        message.data[0] ^= 0xFF
        message.data[1] ^= 0x08
    done = called(folder, messages, "replay")
    assert "1 refused" in str(done.exception)
    assert "it ends at: " in str(done.exception)
    assert "TP1: " in done.output
    assert "retake" in done.output
