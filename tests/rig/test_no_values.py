"""Values that the bus description names as none, and axes that come at different rates."""

from __future__ import annotations

import cantools
import numpy as np
import pytest

from triaxcal.base.errors import RefusedError
from triaxcal.rig.bus.frames import Frames
from triaxcal.rig.description.rigfile import read_description
from triaxcal.rig.samples.samples import CONFLICT, INVALID, LOST_FRAME, SampleDecoder

DBC = """VERSION ""
NS_ :
BS_:
BU_: E
BO_ 256 XY: 8 E
 SG_ X : 0|16@1- (0.001,0) [0|0] "g" E
 SG_ Y : 16|16@1+ (0.001,-32) [0|0] "g" E
 SG_ Count : 32|8@1+ (1,0) [0|0] "" E
BO_ 257 ZT: 8 E
 SG_ Z : 7|16@0- (0.001,0) [0|0] "g" E
 SG_ T : 16|8@1+ (1,-40) [0|0] "degC" E
VAL_ 256 X -32768 "SNA" 0 "No error" 1 "Antenna" ;
VAL_ 256 Y 65535 "Signal not available" 65534 "Accel_Y_Error" 32000 "zero" ;
VAL_ 257 T 255 "Invalid" ;
"""
RATE = 100


def described(folder, more="", dbc=DBC):
    (folder / "imu.dbc").write_text(dbc)
    path = folder / "rig.toml"
    path.write_text(
        'format = 1\n[rig]\nfile = "imu.dbc"\n[signals]\nx = "XY.X"\ny = "XY.Y"\nz = "ZT.Z"\n'
        f'temperature = "ZT.T"\njoin = "age"\nage_s = 0.5\n{more}'
    )
    return read_description(path)


def frames_of(messages):
    """Frames of (time in s, message, values); raw numbers are packed by cantools."""
    database = cantools.database.load_string(DBC)
    rows = []
    for t_s, name, values in sorted(messages, key=lambda m: m[0]):
        message = database.get_message_by_name(name)
        data = message.encode(values, scaling=False, strict=False)
        rows.append((round(t_s * 1e9), message.frame_id, np.frombuffer(data, np.uint8)))
    n = len(rows)
    t_ns, can_id = np.array([r[0] for r in rows]), np.array([r[1] for r in rows], np.uint32)
    data = np.stack([r[2] for r in rows])
    return Frames(t_ns, can_id, np.full(n, 8, np.uint8), np.zeros(n, np.bool_), data)


def xy(k, x=10, y=32010, t_s=None):
    return k / RATE if t_s is None else t_s, "XY", {"X": x, "Y": y, "Count": k % 256}


def zt(k, t=60):
    return k / RATE + 0.002, "ZT", {"Z": 1000 + k % 2, "T": t}


def test_values_named_as_none_are_not_used_and_counted(tmp_path):
    rig = described(tmp_path)
    sent = [zt(k, 255 if k == 40 else 60) for k in range(100)]
    none = {10: (-32768, 32010), 20: (10, 65535), 30: (10, 65534)}
    sent += [xy(k, *none.get(k, (k % 2, 32000))) for k in range(100)]
    found = SampleDecoder(rig, RATE).feed(frames_of(sent))
    assert found.trouble.tolist() == [INVALID] * 4
    assert len(found.codes) == 97
    assert len(found.temp_code) == 99
    # "No error", "Antenna" and "zero" are names of values.
    assert set(found.codes[:, 0].tolist()) == {0, 1}
    assert set(found.codes[:, 1].tolist()) == {32000}


def test_which_names_are_taken_so_is_said(tmp_path):
    x, y, z = described(tmp_path).axes
    assert x.said == "XY.X: the raw integer; no value: -32768 (SNA)"
    assert y.none_said == "no value: 65534 (Accel_Y_Error), 65535 (Signal not available)"
    assert z.said == "ZT.Z: the raw integer"


@pytest.mark.parametrize("every", [2, 4])
@pytest.mark.parametrize("batch", [7, 10**6])
def test_an_axis_slower_than_the_sample_is_refused(tmp_path, every, batch):
    frames = frames_of([xy(k) for k in range(0, 400, every)] + [zt(k) for k in range(400)])
    decode = SampleDecoder(described(tmp_path), RATE)
    cuts = range(0, len(frames), batch)
    with pytest.raises(RefusedError) as refusal:
        _ = [decode.feed(frames.take(slice(start, start + batch))) for start in cuts]
    text = str(refusal.value)
    assert f"ZT comes 100 times a second and XY {RATE // every} times" in text
    assert f'sample_at = "XY", and rate_hz = {RATE // every} in the plan' in text


def test_the_slowest_message_as_sample_at_is_taken(tmp_path):
    frames = frames_of([xy(k) for k in range(0, 400, 2)] + [zt(k) for k in range(400)])
    decode = SampleDecoder(described(tmp_path, 'sample_at = "XY"\n'), RATE // 2)
    assert len(decode.feed(frames).codes) == 199  # the first has no z yet


def test_a_lost_frame_of_the_other_message_is_no_slow_message(tmp_path):
    kept = [xy(k) for k in range(400) if k % 25]
    found = SampleDecoder(described(tmp_path), RATE).feed(
        frames_of(kept + [zt(k) for k in range(400)])
    )
    assert len(found.codes) == 399


def test_two_nodes_of_a_message_that_makes_no_sample_are_a_conflict(tmp_path):
    rig = described(tmp_path, '[message.XY]\ncounter = "Count"\n')
    both = [xy(k) for k in range(100)] + [xy(k, x=36, t_s=k / RATE + 0.001) for k in range(100)]
    frames = frames_of(both + [zt(k) for k in range(100)])
    found = SampleDecoder(rig, RATE).feed(frames)
    assert found.trouble.tolist() == [CONFLICT] * 100
    again = [*(xy(k) for k in range(100) if k != 50), xy(60, t_s=0.6001)]
    found = SampleDecoder(rig, RATE).feed(frames_of(again + [zt(k) for k in range(100)]))
    assert found.trouble.tolist() == [LOST_FRAME]
