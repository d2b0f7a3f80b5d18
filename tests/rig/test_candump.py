"""The evidence log: every frame comes back, torn and spoiled lines do not come as frames."""

from __future__ import annotations

import can
import numpy as np
import pytest
from rig_cases import rig_of, short_setup

from triaxcal.rig.bus.frames import EFF_FLAG, ERR_FLAG, RTR_FLAG, Frames, concatenate, widened
from triaxcal.rig.bus.messages import frames_of, messages_of
from triaxcal.rig.logs.candump import format_frames, parse, read_log


def mixed(seed=1, count=400):
    """Frames of every kind, whole microseconds."""
    rng = np.random.default_rng(seed)
    kinds = rng.integers(0, 5, count)
    parts = []
    for i, kind in enumerate(kinds):
        fd = kind == 4
        size = int(rng.choice([0, 1, 8, 12, 48, 64])) if fd else int(rng.integers(0, 9))
        can_id = int(rng.integers(0, 0x800))
        can_id = [can_id, can_id << 15 | EFF_FLAG, can_id | RTR_FLAG, ERR_FLAG | 0x40, can_id][kind]
        size = 0 if kind == 2 else 8 if kind == 3 else size
        data = np.zeros((1, 64 if fd else 8), np.uint8)
        data[0, :size] = rng.integers(0, 256, size)
        parts.append(
            Frames(
                np.array([1_700_000_000_000_000_000 + i * 137_000]),
                np.array([can_id], np.uint32),
                np.array([size], np.uint8),
                np.array([fd]),
                data,
            )
        )
    return concatenate(parts)


def same(a, b):
    assert len(a) == len(b)
    for name in ("t_ns", "can_id", "length", "fd", "data"):
        x, y = getattr(a, name), getattr(b, name)
        if name == "data":
            x, y = widened(x, 64), widened(y, 64)
        np.testing.assert_array_equal(x, y, err_msg=name)


def test_every_kind_of_frame_comes_back():
    frames = mixed()
    parsed = parse(format_frames(frames, "can0"))
    assert (parsed.lines, parsed.bad_lines) == (400, 0)
    same(parsed.frames, frames)


def test_messages_of_python_can_and_back():
    frames = mixed(2)
    same(frames_of(messages_of(frames)), frames)


def test_python_can_reads_the_log_alike(tmp_path):
    frames = mixed(3)
    frames = frames.take(~frames.is_error)  # python-can keeps no class of an error frame
    path = tmp_path / "x.log"
    path.write_bytes(format_frames(frames, "can0"))
    with can.CanutilsLogReader(str(path)) as reader:
        same(frames_of(list(reader)), frames)


def test_every_truncation_gives_whole_frames_only():
    frames = mixed(4, 12)
    text = format_frames(frames, "can0")
    ends = [i for i, byte in enumerate(text) if byte == ord("\n")]
    for size in range(len(text) + 1):
        whole = sum(end < size for end in ends)
        same(parse(text[:size]).frames, frames.take(slice(0, whole)))


@pytest.mark.parametrize(
    "line",
    [
        "", "x", "(1700000000.000000) can0 100", "(1700000000.00000a) can0 100#00",
        "(1700000000.000000) can0 900#00", "(1700000000.000000) can0 100#0",
        "(1700000000.000000) can0 100#0G", "(1700000000.000000) can0 100#001122334455667788",
        "(1700000000.000000) can0 110##000112233445566778899AABBCCDD",
        "(1700000000.000000)  100#00",
        "(1700000000.000000) can 0 100#00", "1700000000.000000 can0 100#00",
    ],
)  # fmt: skip
def test_what_is_no_frame_is_counted(line):
    good = "(1700000000.000001) can0 101#0102\n"
    parsed = parse(f"{good}{line}\n{good}".encode())
    assert (parsed.lines, parsed.bad_lines, len(parsed.frames)) == (3, 1, 2)


@pytest.mark.parametrize("count", [200, pytest.param(10_000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("layout", ["classic", "fd"])
def test_a_flipped_bit_of_a_log_costs_samples_and_changes_none(tmp_path, layout, count):
    """Without a journal beside it: the frames' own CRC, the lines' form and the lengths."""
    setup = short_setup(tmp_path, layout=layout)
    frames = rig_of(setup).advance()
    text = format_frames(frames, "can0")
    right = {tuple(row) for row in decoded(setup, text)}
    rng = np.random.default_rng(31)
    for bit in rng.integers(0, 8 * len(text), count).tolist():
        spoiled = bytearray(text)
        spoiled[bit // 8] ^= 1 << bit % 8
        found = [tuple(row) for row in decoded(setup, bytes(spoiled))]
        # A lost newline joins two lines, which may be of two samples.
        assert set(found) <= right
        assert len(found) == len(set(found)) >= len(right) - 2


@pytest.mark.parametrize("step", [97, pytest.param(1, marks=pytest.mark.slow)])
def test_a_log_cut_anywhere_gives_the_samples_before_the_cut(tmp_path, step):
    setup = short_setup(tmp_path)
    text = format_frames(rig_of(setup).advance(), "can0")
    right = decoded(setup, text).tolist()
    for size in range(0, len(text), step):
        found = decoded(setup, text[:size]).tolist()
        assert found == right[: len(found)]


def decoded(setup, text):
    """Codes of the samples of a log."""
    decoder = setup.decoder()
    return decoder.feed(parse(text).frames).codes


def test_a_log_is_read_alike_in_any_chunks(tmp_path, monkeypatch):
    frames = rig_of(short_setup(tmp_path)).advance()
    path = tmp_path / "x.log"
    path.write_bytes(format_frames(frames, "vcan0"))
    for size in (10, 97, 4096):
        monkeypatch.setattr("triaxcal.rig.logs.candump._CHUNK_BYTES", size)
        same(concatenate([p.frames for p in read_log(path)]), frames)
