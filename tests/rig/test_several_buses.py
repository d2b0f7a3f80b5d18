"""A sensor on one bus and its thermometer on another one, under the same ID."""

from __future__ import annotations

import struct

import can
import numpy as np
import pytest

from triaxcal.base.errors import RefusedError
from triaxcal.rig.bus.frames import concatenate
from triaxcal.rig.check.census import Census
from triaxcal.rig.description.rigfile import read_description
from triaxcal.rig.logs.candump import format_frames, parse
from triaxcal.rig.samples.samples import SampleDecoder
from triaxcal.rig.sources.source import Wanted, kind_of

HEAD = 'VERSION ""\nNS_ :\nBS_:\nBU_: A\n'
IMU = f"""{HEAD}BO_ 256 IMU: 8 A
 SG_ X : 0|16@1- (1,0) [0|0] "mg" A
 SG_ Y : 16|16@1- (1,0) [0|0] "mg" A
 SG_ Z : 32|16@1- (1,0) [0|0] "mg" A
 SG_ N : 48|8@1+ (1,0) [0|0] "" A
"""
THERMOMETER = f"""{HEAD}BO_ 256 THERMO: 8 A
 SG_ T : 7|16@0- (0.01,0) [0|0] "degC" A
"""
KEYS = """format = 1
[rig]
file = "imu.dbc"
more_files = ["thermometer.dbc"]
channel = "virtual:several-a"
[signals]
x = "IMU.X"
y = "IMU.Y"
z = "IMU.Z"
temperature = "THERMO.T"
[message.IMU]
counter = "N"
"""
OTHER = '[message.THERMO]\nchannel = "virtual:several-b"\n'
BUS = "virtual:several-a+virtual:several-b"


def rig_of(folder, keys):
    (folder / "imu.dbc").write_text(IMU, encoding="utf-8")
    (folder / "thermometer.dbc").write_text(THERMOMETER, encoding="utf-8")
    (folder / "rig.toml").write_text(keys, encoding="utf-8")
    return read_description(folder / "rig.toml")


def read_all(count):
    """Frames of the two buses, on which a sensor and its thermometer send."""
    source = kind_of(BUS).open(Wanted(BUS, False, lambda: None))
    senders = [can.Bus(interface="virtual", channel=f"several-{name}") for name in "ab"]
    parts, sent = [], 0
    try:
        for k in range(count):
            # A reader may be late by any time: what was sent arrives before more is sent.
            while k % 10 == 0 and sum(map(len, parts)) < sent:
                parts.append(source.read())
            imu = struct.pack("<hhhBx", k, -k, 1000, k % 256)
            senders[0].send(can.Message(arbitration_id=256, is_extended_id=False, data=imu))
            sent += 1
            if k % 10 == 0:
                data = struct.pack(">h6x", 2000 + k)
                senders[1].send(can.Message(arbitration_id=256, is_extended_id=False, data=data))
                sent += 1
        while sum(map(len, parts)) < sent:
            parts.append(source.read())
    finally:
        source.close()
        for sender in senders:
            sender.shutdown()
    return concatenate(parts)


def test_live_and_from_the_log(tmp_path):
    rig, count = rig_of(tmp_path, KEYS + OTHER), 200
    frames = read_all(count)
    again = parse(format_frames(frames, BUS)).frames
    for these in (frames, again):
        samples = SampleDecoder(rig, 100).feed(these)
        k = np.arange(count)
        assert samples.codes.tolist() == np.stack([k, -k, 0 * k + 1000], axis=1).tolist()
        assert samples.number.tolist() == k.tolist()
        # Times of one bus may be before the first sample of the other one.
        assert samples.temp_code.tolist()[-19:] == list(range(2010, 2200, 10))
        assert not len(samples.trouble)
    census = Census(rig)
    census.add(again)
    assert census.said() == [
        "IMU (ID 0x100): 200 frames, 200 good", "THERMO (ID 0x100): 20 frames, 20 good"
    ]  # fmt: skip


def test_equal_ids_without_channels_are_refused(tmp_path):
    with pytest.raises(RefusedError) as refused:
        rig_of(tmp_path, KEYS)
    assert str(refused.value) == (
        f"{tmp_path / 'rig.toml'}, [message.THERMO]: its frames cannot be told from those of IMU: "
        "IDs 0x100 and 0x100; expected an ID for each message; state source_address where J1939 "
        "addresses differ, and channel where buses do"
    )


@pytest.mark.parametrize(
    ("bus", "name"),
    [
        ("can0+can1", "several"), ("can0", "socketcan"), ("can0+", "socketcan"),
        ("virtual+can0", "socketcan"), ("replay:a+b.log", "replay"),
        ("lines:/dev/ttyUSB0+1", "lines"), ("pcan:PCAN_USBBUS1,bitrate=500000+can0", "several"),
    ],
)  # fmt: skip
def test_which_source_a_name_is(bus, name):
    assert kind_of(bus).name == name


def test_a_bus_twice_is_refused():
    with pytest.raises(RefusedError, match="with a bus twice"):
        kind_of("can0+can0").open(Wanted("can0+can0", False, lambda: None))
