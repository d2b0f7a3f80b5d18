"""CRCs, the DBC and the decoder by columns, against AUTOSAR's values and cantools."""

from __future__ import annotations

import cantools
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rig_cases import dbc

from recordings import recording
from triaxcal.base.errors import RefusedError
from triaxcal.rig.bus.frames import Frames
from triaxcal.rig.description.busfile import read_bus_file
from triaxcal.rig.description.crc import CRC8_2F, CRC32_P4
from triaxcal.rig.description.dbc import REQUIRED, default_dbc, read_dbc
from triaxcal.rig.description.signals import Signal
from triaxcal.rig.logs.candump import read_log

DATABASE = read_bus_file(default_dbc()).database


def test_crcs_have_autosar_check_values():
    # Specification of CRC Routines: check values for the bytes "123456789".
    data = np.frombuffer(b"123456789", np.uint8)[None]
    assert CRC8_2F.of(data)[0] == 0xDF
    assert CRC32_P4.of(data)[0] == 0x1697D06A


@pytest.mark.parametrize("name", sorted(REQUIRED))
def test_columns_decode_as_cantools(name):
    layout = dbc().messages[name]
    rng = np.random.default_rng(5)
    data = rng.integers(0, 256, (500, layout.size), dtype=np.uint8)
    message = DATABASE.get_message_by_name(name)
    expected = [message.decode(row.tobytes(), scaling=False) for row in data]
    for signal in layout.signals:
        found = layout.raw(signal, data).tolist()
        assert found == [row[signal] for row in expected], signal


@pytest.mark.parametrize("name", sorted(REQUIRED))
def test_columns_pack_as_cantools(name):
    layout = dbc().messages[name]
    rng = np.random.default_rng(6)
    values = {}
    for signal in layout.signals.values():
        low = -(1 << (signal.length - 1)) if signal.signed else 0
        high = low + (1 << signal.length) - 1
        values[signal.name] = rng.integers(low, high, 200, endpoint=True)
    values["RateHz"] = np.maximum(values.get("RateHz", np.ones(200, int)), 1)
    values = {k: v for k, v in values.items() if k in layout.signals and k != "Crc"}
    packed = layout.pack(values)
    message = DATABASE.get_message_by_name(name)
    crc = layout.raw("Crc", packed)
    for i, row in enumerate(packed):
        one = {k: int(v[i]) for k, v in values.items()} | {"Crc": int(crc[i])}
        assert row.tobytes() == message.encode(one)


@given(st.data())
@settings(max_examples=60)
def test_any_signal_decodes_as_cantools(data):
    length = data.draw(st.integers(1, 48))
    start = data.draw(st.integers(0, 63))
    little = data.draw(st.booleans())
    signed = data.draw(st.booleans())
    order = "1" if little else "0"
    text = (
        'VERSION ""\nBU_: A\nBO_ 1 M: 8 A\n'
        f' SG_ S : {start}|{length}@{order}{"-" if signed else "+"} (1,0) [0|0] "" A\n'
    )
    database = cantools.database.can.Database()
    try:
        database.add_dbc_string(text)
    except cantools.database.Error:
        return  # does not fit into eight bytes
    signal = Signal("S", start, length, little, signed)
    payload = np.frombuffer(data.draw(st.binary(min_size=8, max_size=8)), np.uint8)[None]
    expected = database.messages[0].decode(payload.tobytes(), scaling=False)["S"]
    assert signal.raw(payload)[0] == expected
    back = np.zeros((1, 8), np.uint8)
    signal.put(back, signal.raw(payload))
    assert back.tobytes() == database.messages[0].encode({"S": int(expected)}, scaling=False)


@pytest.mark.parametrize("name", ["RIG_XY", "RIG_Z", "RIG_TEMP", "RIG_IDENT", "RIG_FD"])
def test_every_single_bit_flip_is_found(name):
    layout = dbc().messages[name]
    values = {s: np.array([37], np.int64) for s in layout.signals if s != "Crc"}
    good = layout.pack(values)
    data = np.repeat(good, 8 * layout.size + 1, axis=0)
    for bit in range(8 * layout.size):
        data[bit, bit // 8] ^= np.uint8(1 << bit % 8)
    count = len(data)
    frames = Frames(
        np.zeros(count, np.int64),
        np.full(count, layout.frame_id, np.uint32),
        np.full(count, layout.size, np.uint8),
        np.full(count, layout.fd, np.bool_),
        data,
    )
    assert layout.valid(frames).tolist() == [False] * (count - 1) + [True]


def test_a_frame_under_the_wrong_id_is_found():
    xy, z = dbc().messages["RIG_XY"], dbc().messages["RIG_Z"]
    data = z.pack({s: np.array([1]) for s in z.signals if s != "Crc"})
    frames = Frames(
        np.zeros(1, np.int64), np.array([256], np.uint32), np.array([8], np.uint8),
        np.zeros(1, np.bool_), data,
    )  # fmt: skip
    assert not xy.valid(frames)[0]
    assert z.valid(frames)[0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("SG_ AccelX", "SG_ Other"), "missing: signal RIG_XY.AccelX, signal RIG_FD.AccelX"),
        (("BO_ 257 RIG_Z", "BO_ 257 RIG_Q"), "missing: message RIG_Z"),
        (("Crc : 0|8@1+ (1,0) [0|255]", "Crc : 8|8@1+ (1,0) [0|255]"), "the CRC comes first"),
        (("BO_ 256", "BO_ x"), "not a DBC"),
    ],
)
def test_a_wrong_dbc_is_refused(tmp_path, change, message):
    path = tmp_path / "wrong.dbc"
    path.write_text(default_dbc().read_text().replace(*change))
    with pytest.raises(RefusedError, match=r"wrong\.dbc") as refusal:
        read_dbc(path)
    assert message in str(refusal.value)


def test_a_real_log_decodes_to_the_published_means():
    """CSS Electronics' public recording."""
    folder = recording("css_canedge")
    layouts = read_bus_file(folder / "canmod-gps.dbc").layouts()
    layout = next(found for found in layouts if found.frame_id == 9)
    parts = list(read_log(next(folder.glob("*.log"))))
    assert sum(p.lines for p in parts) == 84730
    data = np.concatenate([p.frames.data[p.frames.can_id == 9] for p in parts])
    assert len(data) == 29965
    means = [layout.signals[f"Acceleration{axis}"].value(data).mean() for axis in "XYZ"]
    # Printed to four decimals by an independent decoder.
    np.testing.assert_allclose(means, [-0.4992, -0.1973, 10.5012], atol=5e-5, rtol=0)
