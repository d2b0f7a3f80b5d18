"""Logs of other programs: the same frames from every form of candump and every format."""

from __future__ import annotations

import codecs
import gzip
import sqlite3
import sys
from contextlib import closing
from dataclasses import replace

import can
import numpy as np
import pytest
from click.testing import CliRunner
from rig_cases import rig_of, short_setup
from test_candump import same
from test_cli_rig import bench_copy
from test_export import installed

from triaxcal.base.errors import RefusedError
from triaxcal.cli.rig import rig as command
from triaxcal.rig.bus.frames import (
    BRS,
    DLC_SHIFT,
    EFF_FLAG,
    ERR_FLAG,
    ESI,
    RTR_FLAG,
    SENT,
    Frames,
    concatenate,
)
from triaxcal.rig.bus.messages import messages_of
from triaxcal.rig.logs.candump import format_frames, parse
from triaxcal.rig.logs.export import export_log
from triaxcal.rig.logs.logfile import LOG_FORMATS, Left, LogFormat, read_frames
from triaxcal.rig.records.rawlog import RawLog
from triaxcal.rig.sources.socketcan import frames_of_rows, packed

T0_NS = 1_700_000_000_000_000_000


def read(path):
    """All frames of a log, and what was left out."""
    left, parts = Left(), []
    for parsed in read_frames(path):
        left.add(parsed)
        parts.append(parsed.frames)
    return concatenate(parts), left


def everything(count=300, seed=5):
    """Frames of every kind, with every mark, on two channels; whole microseconds."""
    rng = np.random.default_rng(seed)
    kind = rng.integers(0, 5, count)  # classic, extended, remote, error, CAN FD
    fd = kind == 4
    can_id = rng.integers(0, 0x800, count).astype(np.uint32)
    can_id = np.select(
        [kind == 1, kind == 2, kind == 3],
        [can_id << 15 | EFF_FLAG, can_id | RTR_FLAG, np.full(count, ERR_FLAG | 0x40)],
        can_id,
    ).astype(np.uint32)
    length = np.where(fd, rng.choice([1, 8, 12, 48, 64], count), rng.integers(0, 9, count))
    length = np.where(kind == 3, 8, length).astype(np.uint8)
    data = rng.integers(0, 256, (count, 64)).astype(np.uint8)
    data[np.arange(64) >= np.where(kind == 2, 0, length)[:, None]] = 0
    marks = np.where(fd, rng.integers(0, 4, count), 0)
    raw = (kind == 0) & (length == 8)
    marks += np.where(raw, rng.choice([0, 9, 15], count), 0) << DLC_SHIFT
    marks += np.where(rng.random(count) < 0.3, SENT, 0)
    t_ns = T0_NS + np.arange(count) * 137_000
    channel = np.where(rng.random(count) < 0.5, b"can0", b"can1")
    return Frames(t_ns, can_id, length, fd, data, marks.astype(np.uint8), channel)


def logged(path, messages):
    """Write a file as python-can does."""
    if path.suffix == ".db":  # its own writer loses the last frames on a loaded machine
        rows = [
            (m.timestamp, m.arbitration_id, m.is_extended_id, m.is_remote_frame, m.is_error_frame,
             m.dlc, bytes(m.data))
            for m in messages
        ]  # fmt: skip
        with closing(sqlite3.connect(path)) as base:
            base.execute(
                "CREATE TABLE messages (ts REAL, arbitration_id INTEGER, extended INTEGER, "
                "remote INTEGER, error INTEGER, dlc INTEGER, data BLOB)"
            )
            base.executemany("INSERT INTO messages VALUES (?, ?, ?, ?, ?, ?, ?)", rows)
            base.commit()
        return
    with can.Logger(str(path)) as logger:
        for message in messages:
            logger(message)


def alike(found, frames, *, without=()):
    """The same frames, but for the columns that a format does not keep."""
    same(found, frames)
    for name in ("marks", "channel"):
        if name not in without:
            np.testing.assert_array_equal(getattr(found, name), getattr(frames, name), name)


# ---- Forms of candump ----

LOGGED = """\
(1700000000.000001) can0 100#0102030405060708
(1700000000.000002) can0 12345678#0102
(1700000000.000003) can0 100#R
(1700000000.000004) can0 100#R8
(1700000000.000005) can0 20000040#0000000000000000
(1700000000.000006) can1 123##0AABBCC
(1700000000.000007) can0 123##1AABBCC
(1700000000.000008) can0 12345678##3AABBCC
(1700000000.000009) can0 100#
(1700000000.000010) can0 100#0102030405060708_9
"""
# Of the log above, by log2long of can-utils 2020.11; it has no flags and no length code of 9.
SHOWN = """\
(1700000000.000001)  can0       100   [8]  01 02 03 04 05 06 07 08   '........'
(1700000000.000002)  can0  12345678   [2]  01 02                     '..'
(1700000000.000003)  can0       100   [0]  remote request
(1700000000.000004)  can0       100   [8]  remote request
(1700000000.000005)  can0  20000040   [8]  00 00 00 00 00 00 00 00   ERRORFRAME
(1700000000.000006)  can1       123  [03]  AA BB CC                  '...'
(1700000000.000007)  can0       123  [03]  AA BB CC                  '...'
(1700000000.000008)  can0  12345678  [03]  AA BB CC                  '...'
(1700000000.000009)  can0       100   [0]                            ''
(1700000000.000010)  can0       100   [8]  01 02 03 04 05 06 07 08   '........'
"""
EXPECTED = [
    (0x100, bytes(range(1, 9)), False, 0, b"can0", 8),
    (EFF_FLAG | 0x12345678, b"\1\2", False, 0, b"can0", 2),
    (RTR_FLAG | 0x100, b"", False, 0, b"can0", 0),
    (RTR_FLAG | 0x100, b"", False, 0, b"can0", 8),
    (ERR_FLAG | 0x40, bytes(8), False, 0, b"can0", 8),
    (0x123, b"\xaa\xbb\xcc", True, 0, b"can1", 3),
    (0x123, b"\xaa\xbb\xcc", True, BRS, b"can0", 3),
    (EFF_FLAG | 0x12345678, b"\xaa\xbb\xcc", True, BRS | ESI, b"can0", 3),
    (0x100, b"", False, 0, b"can0", 0),
    (0x100, bytes(range(1, 9)), False, 9 << DLC_SHIFT, b"can0", 8),
]


def rows_of(frames):
    return [
        (i, d[: 0 if i & RTR_FLAG else n].tobytes(), fd, m, c, n)
        for i, n, fd, d, m, c in zip(
            frames.can_id.tolist(), frames.length.tolist(), frames.fd.tolist(), frames.data,
            frames.marks.tolist(), frames.channel.tolist(), strict=True,
        )
    ]  # fmt: skip


def stamped(change):
    """The log with every stamp changed."""
    lines = LOGGED.splitlines(keepends=True)
    return "".join(change(i, line) for i, line in enumerate(lines, 1)).encode()


FORMS = {
    "plain": LOGGED.encode(),
    "CRLF": LOGGED.replace("\n", "\r\n").encode(),
    "direction R": LOGGED.replace("\n", " R\n").encode(),
    "byte order mark": codecs.BOM_UTF8 + LOGGED.encode(),
    "wide characters": LOGGED.encode("utf-16"),
    "gzip": gzip.compress(LOGGED.encode()),
    "nanoseconds": LOGGED.replace(")", "000)").encode(),
    "milliseconds": stamped(lambda i, line: line.replace(line[:19], f"(1700000000.{i:03d})")),
    "date": LOGGED.replace("(1700000000", "(2023-11-14 22:13:20").encode(),
    "flags of newer kernels": LOGGED.replace("##1", "##5").replace("##3", "##7").encode(),
    "dots": LOGGED.replace("#AABBCC", "#AA.BB.CC").replace("0102\n", "01.02\n").encode(),
    "lower case": LOGGED.replace("AABBCC", "aabbcc").encode(),
}


@pytest.mark.parametrize("form", FORMS)
def test_the_same_frames_from_every_form_of_a_log(tmp_path, form):
    path = tmp_path / "x.log"
    path.write_bytes(FORMS[form])
    frames, left = read(path)
    assert rows_of(frames) == EXPECTED
    step_ns = 10**6 if form == "milliseconds" else 1000
    assert frames.t_ns.tolist() == [T0_NS + step_ns * i for i in range(1, 11)]
    assert left.notes(path) == []


def test_nine_digits_of_a_stamp_are_kept(tmp_path):
    path = tmp_path / "x.log"
    path.write_text("(1700000000.123456789) can0 100#00\n(.5) can0 100#00\n(7) can0 100#00\n")
    assert read(path)[0].t_ns.tolist() == [1_700_000_000_123_456_789, 500_000_000, 7 * 10**9]


@pytest.mark.parametrize("form", ["as it is", "colours", "sent", "without times"])
def test_the_screen_of_candump_is_read(tmp_path, form):
    text, sent, timed = SHOWN, form == "sent", form != "without times"
    if form == "colours":
        text = "".join(f"\x1b[31m{line}\x1b[0m\n" for line in SHOWN.splitlines())
    if sent:  # candump -x
        text = SHOWN.replace("can0  ", "can0  TX B E  ").replace("can1  ", "can1  TX B E  ")
    if not timed:
        text = "".join("  " + line[21:] + "\n" for line in SHOWN.splitlines())
    path = tmp_path / "x.txt"
    path.write_text(text)
    frames, left = read(path)
    for found, expected in zip(rows_of(frames), EXPECTED, strict=True):
        marks = SENT | BRS | ESI if sent else 0
        assert found == (*expected[:3], marks, *expected[4:])
    times = [T0_NS + 1000 * i if timed else 0 for i in range(1, 11)]
    assert frames.t_ns.tolist() == times
    assert left.notes("x") == ([] if timed else ["x: 10 frames have no time, 0 is taken"])


@pytest.mark.parametrize(
    "line",
    [
        "(1700000000.000001) can0 100#010", "(1700000000.0000010000) can0 100#01",
        "(9223372037.000001) can0 100#01", "(1700000000.000001) can0 123##00102030405060708AA",
        "(1700000000.000001) can0 100#01_9", "(1700000000.000001) can0 100#R9",
        "(1700000000.000001) can0 100#0102030405060708_8", "(2023-13-14 22:13:20.0) can0 100#01x",
        "(1700000000.000001)  can0  100   [3]  01 02", "DROPCOUNT: dropped 7 CAN frames",
        "(1700000000.000001)  can0  100   [2]  01`02", "(1700000000.000001) can0 900#01",
        " can0  100   [9]  01 02 03 04 05 06 07 08 09", "(1700000000.000001) can0 FFFFFFFF#01",
    ],
)  # fmt: skip
def test_what_is_no_frame_is_counted_and_shown(line):
    good = "(1700000000.000001) can0 101#0102\n"
    parsed = parse(f"{good}{line}\n{good}".encode())
    assert (parsed.lines, parsed.bad_lines, len(parsed.frames)) == (3, 1, 2)
    assert parsed.first_bad[1:-1].removesuffix("...") in line


def test_a_last_line_without_its_end_is_counted(tmp_path):
    path = tmp_path / "x.log"
    path.write_text(LOGGED[:-5])
    frames, left = read(path)
    assert len(frames) == 9
    assert left.notes("x") == [
        "x: 1 line is no frame; the first: '(1700000000.000010) can0 100#01020304050607'"
    ]


def test_a_file_that_is_no_text_takes_no_memory(tmp_path):
    path = tmp_path / "x.log"
    path.write_bytes(b"\xff" * (20 << 20))
    frames, left = read(path)
    assert (len(frames), left.lines) == (0, 1)
    assert len(left.first) < 80


# ---- What is kept ----


def test_our_own_log_keeps_everything():
    frames = everything()
    parsed = parse(format_frames(frames, "can9"))
    assert parsed.bad_lines == 0
    alike(parsed.frames, frames)


def test_frames_without_a_channel_get_the_sources_name(tmp_path):
    log = RawLog(tmp_path / "x.log", "pcan:PCAN USB")
    log.append(rig_of(short_setup(tmp_path)).advance())
    log.close()
    frames, left = read(tmp_path / "x.log")
    assert set(frames.channel.tolist()) == {b"pcan:PCAN_USB"}
    assert left.notes("x") == []


def test_a_receivers_frames_carry_flags_and_length_codes():
    """As the kernel gives them: flags in byte 5, the raw length code in byte 7."""
    frames = everything()
    frames = replace(frames, marks=frames.marks & np.uint8(0xFF ^ SENT))
    raw = packed(frames)
    assert [r[5] for r in raw] == (frames.marks & (BRS | ESI)).tolist()
    found = frames_of_rows(list(zip(frames.t_ns.tolist(), raw, strict=True)))
    alike(found, frames, without=("channel",))


NOT_KEPT = {
    ".log": (),
    ".csv": (),
    ".parquet": (),
    ".mf4": ("name", "code"),
    ".blf": ("name", "code", "sent error"),
    ".asc": ("name", "code", "error"),
}
"""What a format of `rig export` does not keep, as docs/reference/can.md says: the channel's name
(its number is kept), the raw length code (python-can does not read it in MF4), direction or all of
an error frame."""


@pytest.mark.parametrize("suffix", [s for s in NOT_KEPT if s != ".parquet"])
def test_a_round_trip_loses_what_the_documentation_says(tmp_path, suffix):
    if suffix == ".mf4":
        installed("asammdf")
    frames = everything()
    log, target = tmp_path / "x.log", tmp_path / f"y{suffix}"
    log.write_bytes(format_frames(frames, "can0"))
    export_log(log, target, lambda _: None)
    found, left = read(target)
    assert left.notes("x") == []
    alike(found, without(frames, NOT_KEPT[suffix]))


def without(frames, lost):
    error = frames.is_error
    marks, channel = frames.marks.copy(), frames.channel
    can_id, length, data = frames.can_id.copy(), frames.length.copy(), frames.data.copy()
    if "code" in lost:
        marks &= (1 << DLC_SHIFT) - 1
    if "name" in lost:
        channel = np.array([name[3:] for name in channel.tolist()], np.bytes_)
    if "error" in lost:
        can_id[error], length[error], data[error] = ERR_FLAG, 0, 0
    if {"error", "sent error"} & set(lost):
        marks[error] = 0
    return Frames(frames.t_ns, can_id, length, frames.fd, data, marks, channel)


# ---- Files that python-can writes ----

PLAIN = [".asc", ".blf", ".trc", ".mf4", ".csv", ".db", ".log", ".asc.gz", ".log.gz"]


@pytest.mark.parametrize("suffix", PLAIN)
def test_the_same_frames_from_every_format_of_python_can(tmp_path, suffix):
    """Classic data frames: all that each of the formats can hold."""
    if suffix == ".mf4":
        installed("asammdf")
    frames = everything()
    frames = frames.take(~frames.fd & ~frames.flags[1] & ~frames.is_error & (frames.marks == 0))
    path = tmp_path / f"x{suffix}"
    logged(path, messages_of(replace(frames, channel=np.full(len(frames), b"0"))))
    found, left = read(path)
    assert left.notes("x") == []
    if suffix == ".trc":  # a tenth of a millisecond in the columns, the start in days as a float
        off = np.diff(found.t_ns) - np.diff(frames.t_ns)
        assert np.abs(off).max() <= 100_000
        found = replace(found, t_ns=frames.t_ns)
    if suffix.startswith(".asc"):  # the date in its head has milliseconds
        shift_ns = int(frames.t_ns[0] - found.t_ns[0])
        assert 0 <= shift_ns < 1_000_000
        found = replace(found, t_ns=found.t_ns + shift_ns)
    same(found, frames)


def test_a_compressed_blf_is_read(tmp_path):
    frames = everything().take(slice(0, 50))
    with can.BLFWriter(str(tmp_path / "x.blf")) as logger:
        for message in messages_of(frames):
            logger(message)
    packed_file = tmp_path / "x.blf.gz"
    packed_file.write_bytes(gzip.compress((tmp_path / "x.blf").read_bytes()))
    same(read(packed_file)[0], read(tmp_path / "x.blf")[0])
    packed_file.write_bytes(packed_file.read_bytes()[:-20])
    with pytest.raises(RefusedError, match=r"x\.blf\.gz: damaged: .*`gzip -dc`"):
        read(packed_file)


def test_lines_of_asc_that_are_no_frames_are_counted(tmp_path):
    path = tmp_path / "x.asc"
    frames = everything().take(slice(0, 20))
    with can.ASCWriter(str(path)) as logger:
        for message in messages_of(frames):
            logger(message)
    text = path.read_text().replace("Tue Nov 14", "mar nov. 14")
    torn = text.splitlines(keepends=True)
    torn.insert(-1, " 0.5 log trigger event\n")
    torn.insert(-1, " 0.9 1  100             Rx   d 8 01 02\n")
    path.write_text("".join(torn))
    found, left = read(path)
    assert len(found) == 20
    assert left.lines == 2
    # The date is in another language: times from the beginning of the log.
    assert found.t_ns[0] == 0


def test_rows_of_a_table_that_are_no_frames_are_counted(tmp_path):
    path = tmp_path / "x.csv"
    with can.CSVWriter(str(path)) as logger:
        for message in messages_of(everything().take(slice(0, 20))):
            logger(message)
    with path.open("a") as file:
        file.write("1.5,0x1,0,0,0,8,AAA\n1.5,0x1,0,0,0,8,\n1.5,0x1\n")
    _, left = read(path)
    assert left.lines == 3


@pytest.mark.parametrize("suffix", [".blf", ".db", ".trc", ".asc"])
def test_what_is_none_of_it_is_refused_in_one_line(tmp_path, suffix):
    path = tmp_path / f"x{suffix}"
    with pytest.raises(RefusedError, match="cannot be read: no such file"):
        read(path)
    assert not path.exists()
    path.write_bytes(bytes(range(256)) * 40)
    if suffix in {".trc", ".asc"}:
        frames, left = read(path)
        assert len(frames) == 0
        assert left.lines > 0
        return
    with pytest.raises(RefusedError, match="damaged, or not a file of ASC, BLF"):
        read(path)


def test_without_asammdf_the_package_is_named(tmp_path, monkeypatch):
    (tmp_path / "x.mf4").write_bytes(b"MDF     4.10")
    monkeypatch.setitem(sys.modules, "asammdf", None)
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(RefusedError, match="missing package: asammdf; install it: "):
        read(tmp_path / "x.mf4")


def test_a_format_of_ones_own_is_found(tmp_path):
    def twice(path):
        for _ in range(2):
            yield parse(path.read_bytes())

    own = LogFormat("twice", "all twice", "A test.", lambda n, _: n.endswith(".twice"), twice)
    (tmp_path / "x.twice").write_text(LOGGED)
    with LOG_FORMATS.added(own):
        assert len(read(tmp_path / "x.twice")[0]) == 20


# ---- A session from a file ----


@pytest.mark.parametrize("suffix", [".blf", ".asc.gz"])
def test_a_session_is_replayed_from_a_file_of_another_program(tmp_path, suffix):
    """A recording of another tool, three minutes of two positions: dwells as from our own log."""
    unit, setup = bench_copy(tmp_path), short_setup(tmp_path, temps="[20]")
    rig, parts = rig_of(setup), []
    for position in ("TP1", "TP2"):
        rig.turn_to(position)
        parts += [rig.advance() for _ in range(130 if position == "TP1" else 60)]
    frames = concatenate(parts)
    log, other = tmp_path / "x.log", tmp_path / f"y{suffix}"
    log.write_bytes(format_frames(frames, "can0"))
    with can.Logger(str(other)) as logger:
        for message in messages_of(frames):
            logger(message)
    said = [
        CliRunner().invoke(
            command, ["replay", "--unit", str(unit), "--plan", setup.plan.source, str(path)]
        )
        for path in (log, other)
    ]
    assert "accepted: TP2" in said[0].output or "TP2 (-Y up)" in said[0].output
    assert said[0].output == said[1].output
    assert [str(s.exception).replace(str(log), str(other)) for s in said] == [
        str(said[1].exception)
    ] * 2
    assert "holds 2 accepted dwells" in str(said[1].exception)
