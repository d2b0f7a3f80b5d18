"""Counters of any step, several statuses, keys that cannot be: payloads are packed here by hand."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from triaxcal.base.errors import RefusedError
from triaxcal.rig.bus.frames import alike
from triaxcal.rig.check.census import Census
from triaxcal.rig.description.rigfile import read_description
from triaxcal.rig.samples.samples import BAD_CRC, LOST_FRAME, SampleDecoder

DBC = """VERSION ""
NS_ :
BS_:
BU_: A
BO_ 256 IMU: 16 A
 SG_ X : 0|16@1- (1,0) [0|0] "mg" A
 SG_ Y : 16|16@1- (1,0) [0|0] "mg" A
 SG_ Z : 32|16@1- (1,0) [0|0] "mg" A
 SG_ Count : 64|32@1+ (1,0) [0|0] "" A
 SG_ Small : 96|8@1+ (1,0) [0|0] "" A
 SG_ GoodX : 104|1@1+ (1,0) [0|0] "" A
 SG_ GoodY : 105|1@1+ (1,0) [0|0] "" A
 SG_ Fault : 106|3@1+ (1,0) [0|0] "" A
 SG_ Crc : 120|8@1+ (1,0) [0|0] "" A
BO_ 257 TEMP: 8 A
 SG_ T : 0|8@1- (1,0) [0|0] "degC" A
 SG_ Crc : 32|32@1+ (1,0) [0|0] "" A
 SG_ Step : 8|8@1+ (1,0) [0|0] "" A
"""
PERIOD_NS = 10_000_000


def rig_of(folder, keys):
    (folder / "imu.dbc").write_text(DBC, encoding="utf-8")
    path = folder / "rig.toml"
    signals = 'x = "IMU.X"\ny = "IMU.Y"\nz = "IMU.Z"\ntemperature = "TEMP.T"\n'
    path.write_text(
        f'format = 1\n[rig]\nfile = "imu.dbc"\n[signals]\n{signals}{keys}', encoding="utf-8"
    )
    return read_description(path)


def imu_frames(when, counts, small=None, bits=None):
    """Frames number `when` (n,) with their counters and the bits of the statuses."""
    small = np.zeros(len(when), int) if small is None else small
    bits = np.zeros(len(when), int) if bits is None else bits
    rows = [
        struct.pack("<hhhhIBB2x", k % 7, -k % 5, 1000, 0, int(c), int(s), int(b))
        for k, c, s, b in zip(when.tolist(), counts, small, bits, strict=True)
    ]
    data = np.zeros((len(when), 64), np.uint8)
    data[:, :16] = np.frombuffer(b"".join(rows), np.uint8).reshape(-1, 16)
    return alike(10**18 + when * PERIOD_NS, 256, 16, True, data)


@pytest.mark.parametrize(
    ("step", "modulus", "bits"),
    [
        (1, 256, 8), (2, 256, 8), (4, 256, 8), (3, 256, 8), (255, 256, 8), (7, 15, 8),
        (10, 100, 8), (6, 15, 8), (10_000, 2**32, 32), (2**32 - 1, 2**32, 32),
        (40_003, 2**32 - 5, 32),
    ],
)  # fmt: skip
def test_frames_are_numbered_by_a_counter_of_any_step(tmp_path, step, modulus, bits):
    """c(k) = (c(0) + k s) mod m in Python's integers; a lost frame leaves out its number."""
    name = "Count" if bits == 32 else "Small"
    rig = rig_of(
        tmp_path,
        f'[message.IMU]\ncounter = "{name}"\ncounter_step = {step}\ncounter_modulus = {modulus}\n',
    )
    when = np.array([k for k in range(400) if k % 53 not in {0, 20, 21}][1:])
    counts = [(modulus - 3 + int(k) * step) % modulus for k in when]
    decoder = SampleDecoder(rig, 100)
    given = {"counts": counts} if bits == 32 else {"counts": [0] * len(when), "small": counts}
    samples = decoder.feed(imu_frames(when, **given))
    assert samples.number.tolist() == (when - when[0]).tolist()
    assert not samples.jump.any()
    assert not len(samples.trouble)


def test_a_step_that_is_not_described_is_named(tmp_path):
    rig = rig_of(tmp_path, '[message.IMU]\ncounter = "Small"\n')
    census = Census(rig)
    when = np.arange(300)
    census.add(imu_frames(when, [0] * 300, small=when * 4 % 256))
    said = [text for text in census.faults() if "Small" in text]
    assert said == [
        (
            "IMU (ID 0x100): Small grows by 4 from frame to frame, and 1 is described: "
            "counter_step = 4 in rig.toml"
        )
    ]


def test_a_counter_of_another_message_counts_its_lost_frames_by_its_step(tmp_path):
    rig = rig_of(tmp_path, '[message.TEMP]\ncounter = "Step"\ncounter_step = 16\n')
    data = np.zeros((40, 8), np.uint8)
    when = np.array([k for k in range(43) if k not in {9, 10, 30}])
    data[:, 1] = when * 16 % 256
    temps = alike(10**18 + when * PERIOD_NS, 257, 8, False, data)
    samples = SampleDecoder(rig, 100).feed(temps)
    assert samples.trouble.tolist() == [LOST_FRAME] * 3


@pytest.mark.parametrize(
    ("keys", "good"),
    [
        ('status = "Fault"', lambda b: b >> 2 & 7 == 0),
        ('status = ["GoodX", "GoodY"]\nstatus_good = [1]', lambda b: b & 3 == 3),
        (
            'status = ["GoodX", "GoodY", "Fault"]\nstatus_good = [[1], [1], [0, 5]]',
            lambda b: b & 3 == 3 and b >> 2 & 7 in {0, 5},
        ),
    ],
)
def test_every_status_of_a_message_must_be_good(tmp_path, keys, good):
    rig = rig_of(tmp_path, f"[message.IMU]\n{keys}\n")
    bits = np.arange(32)
    samples = SampleDecoder(rig, 100).feed(imu_frames(np.arange(32), [0] * 32, bits=bits))
    assert (samples.status == 0).tolist() == [good(int(b)) for b in bits]


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        (
            '[message.IMU]\nstatus = "GoodX"\nstatus_good = [2]\n',
            "[message.IMU] status_good: found 2; expected 0 to 1, what GoodX holds",
        ),
        (
            '[message.IMU]\nstatus = ["GoodX", "GoodY", "Fault"]\nstatus_good = [[1], [1]]\n',
            ("[message.IMU] status_good: 2 lists; expected one list for all, or one for each of "
            "the 3 of status"),
        ),
        (
            '[message.IMU]\nmux = "Fault"\nmux_value = 8\n',
            "[message.IMU] mux_value: found 8; expected 0 to 7, what Fault holds",
        ),
        (
            '[message.IMU]\ncounter_step = 2\n',
            "[message.IMU] counter_step: found 2; expected a counter",
        ),
        (
            '[message.IMU]\ncounter = "Small"\ncounter_step = 256\n',
            ("[message.IMU] counter_step: found 256; expected at most 255, one less than the "
            "values of the counter"),
        ),
        (
            ('[message.IMU]\ncounter = "Small"\ncrc = "Crc"\nprotection = "e2e-p01"\n'
            'data_id = [300]\ndata_id_mode = "nibble"\n'),
            ("[message.IMU] crc: Crc is in byte 15 of 0 to 15; expected a byte behind it, which "
            "holds four bits of the Data ID"),
        ),
        (
            '[message.TEMP]\ncrc = "Crc"\nprotection = "e2e-p04"\ndata_id = [300]\n',
            ("[message.TEMP] crc: Crc is in byte 4 of 0 to 7; expected 8 bytes before it, the "
            "header of AUTOSAR E2E profile 4"),
        ),
    ],
)  # fmt: skip
def test_keys_that_cannot_be_are_refused(tmp_path, keys, said):
    with pytest.raises(RefusedError) as refused:
        rig_of(tmp_path, keys)
    assert str(refused.value) == f"{tmp_path / 'rig.toml'}, {said}"


def test_a_short_frame_is_counted(tmp_path):
    rig = rig_of(tmp_path, "")
    frames = imu_frames(np.arange(3), [0, 0, 0])
    frames.length[1] = 12
    assert SampleDecoder(rig, 100).feed(frames).trouble.tolist() == [BAD_CRC]
