"""[recording] of a log of CAN frames by a rig description; payloads and CRCs are made by hand."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from triaxcal.base.errors import RefusedError
from triaxcal.readings.opened import RecordingFile
from triaxcal.unit.recordingfile import FileLayout, WrittenFile

DBC = """VERSION ""
NS_ :
BS_:
BU_: N
BO_ 512 XY: 8 N
 SG_ AX : 7|16@0- (0.5,-3) [0|0] "mg" N
 SG_ AY : 23|16@0- (0.5,0) [0|0] "mg" N
 SG_ Count : 32|4@1+ (1,0) [0|0] "" N
 SG_ Valid : 36|1@1+ (1,0) [0|0] "" N
 SG_ Crc : 56|8@1+ (1,0) [0|0] "" N
BO_ 513 ZZ: 8 N
 SG_ AZ : 7|16@0- (0.004903325,0) [0|0] "m/s^2" N
 SG_ Count : 32|4@1+ (1,0) [0|0] "" N
 SG_ Crc : 56|8@1+ (1,0) [0|0] "" N
BO_ 514 WARM: 2 N
 SG_ T : 0|16@1+ (0.01,-40) [0|0] "degC" N
"""
RIG = """format = 1
[rig]
file = "imu.dbc"
[signals]
x = "XY.AX"
y = "XY.AY"
z = "ZZ.AZ"
temperature = "WARM.T"
join = "counter"
[message.XY]
counter = "Count"
crc = "Crc"
protection = "sae-j1850"
status = "Valid"
status_good = [1]
[message.ZZ]
counter = "Count"
crc = "Crc"
protection = "sae-j1850"
"""
COUNT, PERIOD_US, WARM_EVERY = 400, 10_000, 25


def crc(payload: bytes) -> int:
    """CRC-8 of SAE J1850, bit by bit."""
    register = 0xFF
    for byte in payload:
        register ^= byte
        for _ in range(8):
            register = (register << 1 ^ 0x1D if register & 0x80 else register << 1) & 0xFF
    return register ^ 0xFF


def sample(k: int) -> tuple[int, int, int]:
    return k - 200, -3 * k, 2000 + k


def lines(spoiled=(), invalid=(), lost=(), channel="can0"):
    """Lines of a log; of some samples one frame has a flipped bit, is invalid, or is lost."""
    for k in range(COUNT):
        x, y, z = sample(k)
        t_us = 1_700_000_000_000_000 + k * PERIOD_US
        status = k % 16 | (0 if k in invalid else 0x10)
        frames = [(0x200, struct.pack(">hhBxx", x, y, status)),
                  (0x201, struct.pack(">hxxBxx", z, k % 16))]  # fmt: skip
        for place, (number, body) in enumerate(frames):
            payload = body + bytes([crc(body)])
            if k in spoiled and place == 1:
                payload = bytes([payload[0] ^ 4]) + payload[1:]
            if k in lost and place == 0:
                continue
            at = t_us + 300 * place
            yield f"({at // 10**6}.{at % 10**6:06d}) {channel} {number:03X}#{payload.hex().upper()}"
        if k % WARM_EVERY == 3:
            at, word = t_us + 900, struct.pack("<H", 6000 + k).hex().upper()
            yield f"({at // 10**6}.{at % 10**6:06d}) {channel} 202#{word}"


def written(folder, rows, rig=RIG):
    (folder / "imu.dbc").write_text(DBC, encoding="utf-8")
    (folder / "rig.toml").write_text(rig, encoding="utf-8")
    path = folder / "drive.log"
    path.write_text("\n".join(rows) + "\n", encoding="ascii")
    return path


def read(path, *names):
    """Columns of a recording, and the file."""
    file = RecordingFile(path, FileLayout("recording", names, format="can", rig="rig.toml"))
    columns = [file.index(name, "acceleration") for name in names]
    return np.concatenate([b.numbers for b in file.blocks(columns)]), file


def test_axes_of_two_messages_in_other_units_with_the_temperature_beside_them(tmp_path):
    path = written(tmp_path, lines())
    values, file = read(path, "x", "y", "z", "temperature", "x_code", "temperature_code", "time")
    # Samples 0 to 3 come before the first temperature, which is behind sample 3.
    k = np.arange(4, COUNT)
    x, y, z = np.array([sample(int(i)) for i in k], float).T
    last = (k - 4) // WARM_EVERY * WARM_EVERY + 3
    # Products of three floats: two roundings, each of half a unit in the last place.
    np.testing.assert_allclose(values[:, 0], (x * 0.5 - 3) / 1000, rtol=5e-16)
    np.testing.assert_allclose(values[:, 1], y * 0.5 / 1000, rtol=5e-16)
    np.testing.assert_allclose(values[:, 2], z / 2000, rtol=1e-15)
    np.testing.assert_allclose(values[:, 3], (6000 + last) * 0.01 - 40, rtol=5e-16)
    np.testing.assert_array_equal(values[:, 4], x)
    np.testing.assert_array_equal(values[:, 5], 6000 + last)
    np.testing.assert_array_equal(np.diff(values[:, 6]), PERIOD_US * 1000)
    assert {file.source.names[i]: u for i, u in file.source.units.items()} == {
        "x": "g", "y": "g", "z": "g", "temperature": "degC", "x_code": "code", "y_code": "code",
        "z_code": "code", "temperature_code": "code",
    }  # fmt: skip
    assert file.source.findings[0] == "4 samples before the first temperature, left out"


def test_what_the_rig_description_finds_is_left_out_and_counted(tmp_path):
    """Without the temperature every sample counts."""
    path = written(tmp_path, lines(spoiled={50, 51}, invalid={90}, lost={200, 201, 300}))
    values, file = read(path, "x_code", "z_code")
    left_out = {50, 51, 90, 200, 201, 300}
    kept = [k for k in range(COUNT) if k not in left_out]
    np.testing.assert_array_equal(values[:, 0], [sample(k)[0] for k in kept])
    np.testing.assert_array_equal(values[:, 1], [sample(k)[2] for k in kept])
    said = file.source.findings
    assert "2 frames with a wrong CRC, length or kind" in said
    assert "5 frames without their partner" in said
    assert "5 samples lost" in said
    assert "1 samples with a status that is not good, left out" in said
    assert "no serial number: a unit that is another one is not noticed" in said


def test_a_key_rig_makes_it_a_log_of_frames():
    assert WrittenFile(rig="rig.toml").layout("recording", ()).format == "can"


def test_one_of_dbc_and_rig(tmp_path):
    path = written(tmp_path, lines())
    layout = FileLayout("recording", (), format="can", rig="rig.toml", dbc="imu.dbc")
    with pytest.raises(RefusedError) as refused:
        RecordingFile(path, layout).index("x", "acceleration")
    assert "[recording]: dbc and rig; expected one of them" in str(refused.value)


def test_a_log_of_another_bus_says_what_came(tmp_path):
    rows = [line.replace(" 200#", " 300#") for line in lines()]
    path = written(tmp_path, rows)
    with pytest.raises(RefusedError) as refused:
        read(path, "x", "y", "z")
    assert "no sample of" in str(refused.value)
    assert "XY (ID 0x200): no frame; other IDs that came, the nearest first: 0x300 (400)" in str(
        refused.value
    )
