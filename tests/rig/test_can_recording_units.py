"""[recording] of a log of CAN frames: what is no number, other units, what is not looked at."""

from __future__ import annotations

import can
import pytest

from triaxcal.base.errors import RefusedError
from triaxcal.readings.samples import read_samples
from triaxcal.rig.bus.messages import frames_of
from triaxcal.rig.logs.candump import format_frames
from triaxcal.unit.description import read_unit

DBC = """VERSION ""
BS_:
BU_: N
BO_ 2566845056 Imu: 8 N
 SG_ AX : 0|16@1+ (0.001,-32) [0|0] "{x}" N
 SG_ AY : 16|16@1+ (0.001,-32) [0|0] "{y}" N
 SG_ AZ : 32|16@1+ (0.001,-32) [0|0] "{z}" N
 SG_ Temp : 48|8@1+ (1,-40) [0|0] "{t}" N
 SG_ Crc : 56|8@1+ (1,0) [0|0] "" N
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";
BA_DEF_DEF_ "VFrameFormat" "J1939PG";
BA_ "VFrameFormat" BO_ 2566845056 3;
"""
UNIT = """format = 1
serial = "R-1"
[site]
local_gravity_m_per_s2 = 9.8111
[recording]
file = "x.log"
dbc = "imu.dbc"
acceleration = ["AX", "AY", "AZ"]
acceleration_unit = "{unit}"
temperature = "Temp"
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "R-1").mkdir()
    return tmp_path / "R-1"


def read(folder, payloads, unit="m/s^2", dbc=DBC, **units):
    """Samples of these payloads, sent every 10 ms."""
    said = {"x": "m/s2", "y": "m/s^2", "z": "m/s/s", "t": "deg C", **units}
    for key, text in said.items():
        dbc = dbc.replace("{" + key + "}", text)
    (folder / "imu.dbc").write_text(dbc)
    (folder / "unit.toml").write_text(UNIT.format(unit=unit))
    messages = [
        can.Message(timestamp=1.7e9 + i / 100, arbitration_id=0x18FEF280, data=data)
        for i, data in enumerate(payloads)
    ]
    (folder / "x.log").write_bytes(format_frames(frames_of(messages), "can0"))
    description = read_unit(folder)
    assert description.recording is not None
    return read_samples(folder, description.recording, description.temperature_sensor)


def payload(x=32000, y=32000, z=41807, temp=60):
    return b"".join(v.to_bytes(2, "little") for v in (x, y, z)) + bytes([temp, 0])


@pytest.mark.parametrize("z", [0xFFFF, 0xFE00, 0xFB00])
def test_values_that_j1939_reserves_are_left_out_and_counted(folder, z):
    sent = [payload(), payload(z=z), *[payload()] * 50, payload(0xFFFF, 0xFFFF, 0xFFFF)]
    samples = read(folder, sent)
    assert len(samples) == 51
    said = "2 frames of Imu hold no value (error, not available), left out"
    assert said in samples.findings


def test_the_largest_number_that_is_one_is_kept(folder):
    assert len(read(folder, [payload(z=0xFAFF)] * 50)) == 50


def test_signals_that_are_not_looked_at_are_named(folder):
    (said,) = (s for s in read(folder, [payload()] * 50).findings if "not looked at" in s)
    assert said.startswith("Imu: not looked at: Crc; ")


@pytest.mark.parametrize(
    ("unit", "units", "said"),
    [
        ("g", {}, r"Imu.AX: its unit is 'm/s\^2'; expected 'g', acceleration_unit"),
        ("m/s^2", {"y": "mg"}, r"Imu.AY: its unit is 'mg'; expected 'm/s\^2'"),
        ("m/s^2", {"z": "degC"}, "Imu.AZ: its unit is 'degC'"),
        ("mg", {"x": "mg", "y": "mg", "z": "ug"}, "Imu.AZ: its unit is 'ug'; expected 'mg'"),
        ("m/s^2", {"t": "K"}, "Imu.Temp: its unit is 'K'; expected 'degC', temperature_unit"),
    ],
)
def test_another_unit_than_that_of_the_bus_description_is_refused(folder, unit, units, said):
    with pytest.raises(RefusedError, match=said):
        read(folder, [payload()] * 50, unit, **units)


def test_a_unit_that_says_nothing_is_taken_as_stated(folder):
    samples = read(folder, [payload()] * 50, x="", y="gn/9.8", z="")
    assert len(samples) == 50


MUXED = DBC.replace("Crc : 56", "Mux M : 56").replace("AZ :", "AZ m1 :").replace("AX :", "AX m0 :")


def test_axes_of_several_frames_are_said_to_be_multiplexed(folder):
    said = r"Imu \(ID 0x18FEF280\): 50 frames, and none holds all of .*multiplexed by Mux"
    with pytest.raises(RefusedError, match=said):
        read(folder, [payload()] * 50, dbc=MUXED)


def test_a_log_of_values_that_are_all_reserved_says_so(folder):
    with pytest.raises(RefusedError, match="none of 9 frames is whole: 9 frames of Imu hold no"):
        read(folder, [payload(0xFFFF, 0xFFFF, 0xFFFF)] * 9)


def test_a_table_without_frames_is_no_log(folder):
    read(folder, [payload()] * 50)
    (folder / "x.csv").write_text("time_s,id,length,fd,payload\n1,0xZZ,8,0,00\n")
    text = UNIT.format(unit="m/s^2").replace('"x.log"', '"x.csv"\nformat = "can"')
    (folder / "unit.toml").write_text(text)
    description = read_unit(folder)
    with pytest.raises(RefusedError, match="no frames in it; its first line is '1,0xZZ,8,0,00"):
        read_samples(folder, description.recording, description.temperature_sensor)
