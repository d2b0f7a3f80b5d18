"""[recording] of a log of CAN frames: signals by a bus description, whatever logged them."""

from __future__ import annotations

import can
import cantools
import numpy as np
import pytest
from test_export import installed
from test_logs import logged

from recordings import recording
from triaxcal.base.errors import RefusedError
from triaxcal.readings.opened import RecordingFile
from triaxcal.rig.bus.messages import frames_of
from triaxcal.rig.logs.candump import format_frames
from triaxcal.unit.description import read_unit
from triaxcal.unit.recordingfile import FileLayout

DBC = """VERSION ""
BS_:
BU_: N
BO_ 2147484160 Imu: 8 N
 SG_ AX : 7|16@0- (0.001,0) [0|0] "g" N
 SG_ AY : 23|16@0- (0.001,0) [0|0] "g" N
 SG_ AZ : 39|16@0- (0.001,0.5) [0|0] "g" N
BO_ 291 Slow: 8 N
 SG_ Kind M : 0|8@1+ (1,0) [0|0] "" N
 SG_ T m1 : 8|16@1- (0.01,25) [0|0] "degC" N
"""
NAMES = ("AX", "AY", "AZ")


def messages(count=500, channel=None):
    """Of both messages, in turn, with the readings that cantools encodes."""
    database = cantools.database.load_string(DBC, "dbc")
    rng = np.random.default_rng(8)
    wanted, sent = [], []
    for i in range(count):
        values = (rng.integers(-2000, 2000, 3) / 1000.0).tolist()
        data = database.encode_message("Imu", dict(zip(NAMES, values, strict=True)))
        wanted.append(list(database.decode_message("Imu", data).values()))
        sent.append(can.Message(timestamp=1.7e9 + i * 0.01, arbitration_id=0x200, data=data,
                                is_extended_id=True, channel=channel))  # fmt: skip
        kind = i % 2
        data = database.encode_message("Slow", {"Kind": 1, "T": 20.0 + i / 100})
        sent.append(can.Message(timestamp=1.7e9 + i * 0.01 + 0.001, arbitration_id=291,
                                data=bytes([kind]) + data[1:], is_extended_id=False,
                                channel=channel))  # fmt: skip
    return np.array(wanted), sent


def read(path, names=NAMES):
    """Columns of a recording, and the times of their message in ns."""
    file = RecordingFile(path, FileLayout("recording", names, format="can", dbc="imu.dbc"))
    columns = [file.index(name, "acceleration") for name in names]
    clock, unit = file.source.clocks[file.source.tables[columns[0]]]
    assert unit == "ns"
    table = np.concatenate([b.numbers for b in file.blocks([*columns, clock])])
    return table[:, :-1], table[:, -1], file


@pytest.mark.parametrize("suffix", [".blf", ".asc", ".log", ".log.gz", ".db", ".mf4", ".csv"])
def test_the_signals_of_any_log(tmp_path, suffix):
    if suffix == ".mf4":
        installed("asammdf")
    wanted, sent = messages()
    (tmp_path / "imu.dbc").write_text(DBC)
    path = tmp_path / f"x{suffix}"
    logged(path, sent)
    values, t_ns, _ = read(path)
    np.testing.assert_array_equal(values, wanted)
    np.testing.assert_allclose(t_ns, np.arange(500) * 1e7, atol=1001)


def test_a_multiplexed_signal_is_taken_where_it_is(tmp_path):
    (tmp_path / "imu.dbc").write_text(DBC)
    (tmp_path / "x.log").write_bytes(format_frames(frames_of(messages()[1]), "can0"))
    values, t_ns, _ = read(tmp_path / "x.log", ("T",))
    np.testing.assert_allclose(values[:, 0], 20.0 + np.arange(1, 500, 2) / 100, atol=0.005)
    assert len(t_ns) == 250


def test_what_was_left_out_is_found(tmp_path):
    (tmp_path / "imu.dbc").write_text(DBC)
    text = format_frames(frames_of(messages(20)[1]), "can0")
    short = b"(1700000009.000000) can0 00000200#0102\nno frame\n"
    (tmp_path / "x.log").write_bytes(text + short)
    values, _, file = read(tmp_path / "x.log")
    assert len(values) == 20
    assert file.source.findings == (
        "x.log: 1 line is no frame; the first: 'no frame'", "1 frames of Imu are too short"
    )  # fmt: skip


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"dbc": None}, r'no bus description; expected dbc = "FILE"'),
        ({"dbc": "none.dbc"}, "none.dbc: cannot be read: no such file"),
        (
            {"names": ("AX", "AY", "Az2")},
            r"no column .Az2.*expected one of Imu.time, Imu.AX, Imu.AY",
        ),
        ({"names": ("AX", "AY", "T")}, "columns of several tables: Imu.*, Slow"),
        ({"channels": ("can0", "can1")}, "Imu comes on several channels: can0, can1"),
        ({"messages": slice(1, 2)}, r"no frame of Imu \(ID 0x200\)"),
    ],
)
def test_bad_input_is_refused_by_name(tmp_path, change, said):
    (tmp_path / "imu.dbc").write_text(DBC)
    sent = messages(10)[1][change.get("messages", slice(None))]
    channels = change.get("channels", ("can0",))
    lines = [format_frames(frames_of(sent), name) for name in channels]
    (tmp_path / "x.log").write_bytes(b"".join(lines))
    names = change.get("names", NAMES)
    layout = FileLayout("recording", names, format="can", dbc=change.get("dbc", "imu.dbc"))
    with pytest.raises(RefusedError, match=said):
        _all_of(tmp_path / "x.log", layout, names)


def _all_of(path, layout, names):
    file = RecordingFile(path, layout)
    list(file.blocks([file.index(name, "acceleration") for name in names]))


def test_a_logger_in_a_car_gives_the_means_that_its_log_has(tmp_path):
    """CANedge with a CANmod.gps: at rest, as cantools decodes the same frames."""
    folder = recording("css_canedge")
    (log,) = folder.glob("*.log")
    for file in (log, folder / "canmod-gps.dbc"):
        (tmp_path / file.name).symlink_to(file)
    (tmp_path / "unit.toml").write_text(
        f"""format = 1
serial = "CSS"
[site]
local_gravity_m_per_s2 = 9.81
[recording]
file = "{log.name}"
dbc = "canmod-gps.dbc"
acceleration = ["AccelerationX", "AccelerationY", "gnss_imu.AccelerationZ"]
acceleration_unit = "m/s^2"
"""
    )
    layout = read_unit(tmp_path).recording
    assert layout is not None
    file = RecordingFile(tmp_path / log.name, layout.written)
    columns = [file.index(c.column, "acceleration") for c in layout.acceleration]
    table = np.concatenate([block.numbers for block in file.blocks(columns)])
    assert len(table) == 29965
    assert table.mean(axis=0) == pytest.approx([-0.4992, -0.1973, 10.5012], abs=5e-5)
