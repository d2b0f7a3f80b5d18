"""Any message of any bus description, decoded by columns, against cantools; files that are odd."""

from __future__ import annotations

import math

import numpy as np
import pytest
from bus_cases import database_of, decoded, messages, payloads
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from triaxcal.base.errors import RefusedError
from triaxcal.rig.bus.frames import EFF_FLAG, ERR_FLAG, RTR_FLAG
from triaxcal.rig.description.busfile import read_bus_file
from triaxcal.rig.simulated.simpack import Packer

FRAMES = 60
ONE = ' SG_ A : 0|8@1+ (1,0) [0|0] "" E\n'
HEAD = 'VERSION ""\nNS_ :\nBS_:\nBU_: E\nBO_ 1 M: 8 E\n'


def bits(value):
    """A float as its bits; all that are no numbers are one."""
    return "nan" if math.isnan(value) else np.float64(value).tobytes()


def agree(folder, message, seed, count):
    """Decode random frames of a message both ways."""
    path = folder / "random.dbc"
    path.write_bytes(database_of(message).as_dbc_string().encode("cp1252"))
    (layout,) = read_bus_file(path).layouts()
    assert layout.can_id == message.frame_id | (EFF_FLAG if message.is_extended_frame else 0)
    assert layout.size == message.length
    data = payloads(message, count, seed)
    # A contiguous payload of eight bytes is decoded another way than one among others.
    wide = np.zeros((count, 64), np.uint8)
    wide[:, : layout.size] = data
    expected = [decoded(message, row.tobytes(), True) for row in data]
    sent = [decoded(message, row.tobytes(), False) for row in data]
    for name, signal in layout.signals.items():
        there = np.ones(count, np.bool_)
        for condition in layout.multiplexed.get(name, ()):
            there &= condition.holds(data)
        values, numbers = signal.value(data), signal.number(data).tolist()
        assert [bits(v) for v in signal.value(wide)] == [bits(v) for v in values]
        for row in range(count):
            if expected[row] is None or sent[row] is None:
                continue
            assert there[row] == (name in expected[row]), (signal, data[row].tobytes().hex())
            if there[row]:
                where = signal, data[row].tobytes().hex()
                assert bits(values[row]) == bits(float(expected[row][name])), where
                assert bits(float(numbers[row])) == bits(float(sent[row][name])), where
                if not signal.is_float:
                    assert numbers[row] == sent[row][name], where


@given(message=messages(), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
def test_random_messages_decode_as_cantools(tmp_path_factory, message, seed):
    agree(tmp_path_factory.getbasetemp(), message, seed, FRAMES)


@pytest.mark.slow
@given(message=messages(), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=1000, deadline=None, suppress_health_check=list(HealthCheck))
def test_a_hundred_thousand_random_frames_decode_as_cantools(tmp_path_factory, message, seed):
    agree(tmp_path_factory.getbasetemp(), message, seed, 100)


@given(message=messages(), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None, suppress_health_check=list(HealthCheck))
def test_the_simulated_rig_packs_as_cantools(message, seed):
    """Sums of bits, against the encoding of whole messages."""
    rng = np.random.default_rng(seed)
    selectors = {s.multiplexer_signal for s in message.signals} - {None}
    if any(len(s.multiplexer_ids or [0]) == 0 for s in message.signals):
        return
    case = dict.fromkeys(selectors, 0)
    chosen = [s for s in message.signals if s.multiplexer_ids is None or 0 in s.multiplexer_ids]
    if selectors and all(s.multiplexer_ids is None for s in chosen):
        return  # cantools encodes no message without a signal for the case
    raw, values = {}, dict(case)
    for signal in chosen:
        if signal.is_multiplexer and signal.name in selectors:
            continue
        drawn = rng.integers(0, 2**63, 3, dtype=np.uint64) & np.uint64((1 << signal.length) - 1)
        if signal.is_float:
            kinds = {32: ("<u4", "<f4"), 64: ("<u8", "<f8")}[signal.length]
            some = rng.standard_normal(3).astype(kinds[1])
            raw[signal.name] = some.view(kinds[0]).astype(np.uint64)
            values[signal.name] = some.tolist()
        else:
            raw[signal.name] = drawn
            half = 1 << (signal.length - 1)
            values[signal.name] = [
                int(v) - 2 * half if signal.is_signed and v >= half else int(v) for v in drawn
            ]
    if not raw:
        return
    packed = Packer(message, case).pack(raw)
    for row in range(3):
        one = {k: v[row] if isinstance(v, list) else v for k, v in values.items()}
        assert packed[row].tobytes() == message.encode(one, scaling=False, strict=False)


@pytest.mark.parametrize("suffix", ["kcd", "sym"])
def test_other_formats_say_the_same(tmp_path, suffix):
    path = tmp_path / "a.dbc"
    path.write_text(
        HEAD
        + ' SG_ X : 7|16@0- (0.5,-3) [0|0] "g" E\n SG_ Y : 16|12@1+ (1,0) [0|0] "" E\n'
        + ' SG_ Z : 32|32@1- (1,0) [0|0] "" E\nSIG_VALTYPE_ 1 Z : 1;\n'
    )
    file = read_bus_file(path)
    other = tmp_path / f"a.{suffix}"
    other.write_text(getattr(file.database, f"as_{suffix}_string")(), encoding="utf-8")
    (first,), (second,) = file.layouts(), read_bus_file(other).layouts()
    assert first.signals.keys() == second.signals.keys()
    data = np.random.default_rng(4).integers(0, 256, (50, 8), dtype=np.uint8)
    for name, signal in first.signals.items():
        np.testing.assert_array_equal(signal.value(data), second.signals[name].value(data))


def test_a_file_that_breaks_the_letter_is_read_with_a_warning(tmp_path):
    path = tmp_path / "overlap.dbc"
    path.write_text(HEAD + ONE + ' SG_ B : 4|8@1+ (1,0) [0|0] "" E\n')
    file = read_bus_file(path)
    assert "overlapping" in file.warnings[0]
    assert [layout.name for layout in file.layouts()] == ["M"]
    path.write_text(HEAD.replace("BS_:", "BS_: 1000000 : 0,0") + ONE)
    assert read_bus_file(path).warnings == (f"{path}: 'BS_: 1000000 : 0,0' is obsolete, not read",)


def test_units_of_windows_code_page_are_read(tmp_path):
    path = tmp_path / "degrees.dbc"
    for encoding in ("cp1252", "utf-8", "utf-8-sig"):
        path.write_bytes((HEAD + ONE.replace('""', '"°C"')).encode(encoding))
        (layout,) = read_bus_file(path).layouts()
        assert layout.signals["A"].unit == "°C"


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.txt", HEAD, "ending '.txt'; expected one of .dbc, .kcd, .sym, .arxml"),
        ("a.dbc", "BO_ x", "not a DBC: "),
        ("a.kcd", "<a", "not a KCD: "),
        ("nothing.dbc", None, "no such file"),
    ],
)
def test_what_is_no_bus_description_is_refused(tmp_path, name, content, message):
    path = tmp_path / name
    if content is not None:
        path.write_text(content)
    with pytest.raises(RefusedError) as refusal:
        read_bus_file(path)
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)


def layout_with_id(tmp_path, frame_id, extra=""):
    path = tmp_path / "id.dbc"
    path.write_text(HEAD.replace("BO_ 1 ", f"BO_ {frame_id} ") + ONE + extra)
    (layout,) = read_bus_file(path).layouts()
    return layout


J1939 = (
    'BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";\n'
    'BA_DEF_DEF_ "VFrameFormat" "J1939PG";\n'
)


@pytest.mark.parametrize(
    ("stated", "sent", "mine"),
    [
        # PGN 0xFEF5 for all: any priority, this source address.
        (0x18FEF580, 0x18FEF580, True),
        (0x18FEF580, 0x0CFEF580, True),
        (0x18FEF580, 0x18FEF581, False),
        (0x18FEF580, 0x18FEF480, False),
        (0x18FEF580, 0x19FEF580, False),  # another data page
        # PGN 0xEF00 for one destination: the second byte is the destination.
        (0x18EF2180, 0x18EF3380, True),
        (0x18EF2180, 0x18EE2180, False),
        # The null address leaves the source open.
        (0x18FEF5FE, 0x18FEF517, True),
    ],
)
def test_j1939_matches_by_pgn_and_source_address(tmp_path, stated, sent, mine):
    layout = layout_with_id(tmp_path, EFF_FLAG | stated, J1939)
    assert layout.j1939
    ids = np.array([sent | EFF_FLAG, sent | EFF_FLAG | ERR_FLAG, sent & 0x7FF], np.uint32)
    assert layout.mine(ids).tolist() == [mine, False, False]


def test_an_id_matches_whole_and_with_its_flags(tmp_path):
    layout = layout_with_id(tmp_path, EFF_FLAG | 0x123)
    ids = np.array([0x123, EFF_FLAG | 0x123, EFF_FLAG | RTR_FLAG | 0x123], np.uint32)
    assert layout.mine(ids).tolist() == [False, True, False]
