"""Sources that speak in lines: what a line says, serial ports, instruments by VISA, their log."""

from __future__ import annotations

import os
import socket
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from instrument_cases import SIMULATED

from triaxcal.base.errors import RefusedError, UsageError
from triaxcal.rig.bus.frames import concatenate
from triaxcal.rig.description.lines import LineFormat, frames_of_lines
from triaxcal.rig.logs.linelog import log_text, parsed
from triaxcal.rig.sources.source import Wanted, kind_of

XYZT = LineFormat(columns=("x", "y", "z", "temperature"))
NS = 1_700_000_000_123_456_000


def numbers(frames, row=0):
    return frames.data[row].view("<f8")[: frames.length[row] // 8].tolist()


@pytest.mark.parametrize(
    ("lines", "text", "values"),
    [
        (XYZT, b"0.1,-0.55,2.5e-2,23.4", [0.1, -0.55, 0.025, 23.4]),
        (XYZT, b" +1.00000E-01, -5.5 ,0,1\r", [0.1, -5.5, 0.0, 1.0]),
        (
            LineFormat(columns=("-", "z", "y", "x", "temperature"), separator=";", decimal=","),
            b"12:00:01;0,3;0,2;0,1;20", [0.3, 0.2, 0.1, 20.0],
        ),
        (LineFormat(columns=("x", "y", "z", "-"), separator=" "), b"1  2\t3 ok", [1.0, 2.0, 3.0]),
    ],
)  # fmt: skip
def test_the_columns_of_a_line(lines, text, values):
    frames = frames_of_lines(lines, [NS], [text])
    assert numbers(frames) == values
    assert frames.texts == (text,)


@pytest.mark.parametrize("text", [b"", b"1,2,3", b"1,2,3,4,5", b"\xff\xfe\x00", b"x,y"])
def test_a_line_of_another_form_has_no_payload(text):
    assert frames_of_lines(XYZT, [NS], [text]).length.tolist() == [0]


@pytest.mark.parametrize("field", ["abc", "", "nan", "inf", "1.2.3", "--", "9.9E+999"])
def test_what_is_no_number_is_nan(field):
    values = numbers(frames_of_lines(XYZT, [NS], [f"1,{field},3,4".encode()]))
    assert values[0] == 1.0
    assert np.isnan(values[1])


@pytest.mark.parametrize(
    ("key", "kind", "field", "value"),
    [
        ("integers", "<i4", "17", 17), ("integers", "<i4", " -3", -3),
        ("integers", "<i4", "2147483648", None), ("integers", "<i4", "1.5", None),
        ("counters", "<u4", "4294967295", 2**32 - 1), ("counters", "<u4", "-1", None),
        ("counters", "<u4", "0x1F", None),
    ],
)  # fmt: skip
def test_integers(key, kind, field, value):
    """A line without its whole numbers is none."""
    lines = LineFormat(columns=("n", "x", "y", "z"), **{key: ("n",)})
    frames = frames_of_lines(lines, [NS], [f"{field},1,2,3".encode()])
    found = frames.data[0].view(kind)[0] if frames.length[0] else None
    assert found == value


@given(st.lists(st.binary(max_size=40).filter(lambda t: b"\n" not in t), max_size=8))
def test_the_log_keeps_every_byte_of_a_line(texts):
    frames = frames_of_lines(XYZT, [NS + 1000 * i for i in range(len(texts))], texts)
    log = log_text(frames, "/dev/tty USB0")
    assert log.isascii()
    found = parsed(XYZT, log + b"(1700000000.1234")
    assert found.frames.texts == tuple(texts)
    assert found.frames.t_ns.tolist() == frames.t_ns.tolist()
    np.testing.assert_array_equal(found.frames.data, frames.data)
    assert (found.lines, found.bad_lines) == (len(texts), 0)


def test_a_log_with_lines_of_another_form():
    text = b"(1700000000.123456) tty0 1,2,3,4\nnothing\n(17.1) tty0 1\n"
    found = parsed(XYZT, text)
    assert (len(found.frames), found.lines, found.bad_lines) == (1, 3, 2)
    assert "nothing" in found.first_bad
    assert found.frames.t_ns.tolist() == [NS]


def test_the_log_of_a_line_can_be_read_by_a_person():
    frames = frames_of_lines(XYZT, [NS + 999], [b"0.1,2,3\t4\\"])
    assert log_text(frames, "COM3") == b"(1700000000.123456) COM3 0.1,2,3\\x094\\x5C\n"


def test_lines_stay_beside_their_frames():
    frames = frames_of_lines(XYZT, [NS, NS, NS], [b"1,2,3,4", b"a", b"5,6,7,8"])
    assert frames.take(np.array([2, 0])).texts == (b"5,6,7,8", b"1,2,3,4")
    assert frames.take(slice(1, None)).texts == (b"a", b"5,6,7,8")
    assert concatenate([frames.take(slice(1)), frames.take(slice(1, 3))]).texts == frames.texts


def opened(bus, lines=XYZT):
    return kind_of(bus).open(Wanted(bus, False, lambda: None, lines))


def read_until(source, count, limit_s=20.0):
    parts, end = [], time.monotonic() + limit_s
    while sum(map(len, parts)) < count and time.monotonic() < end:
        parts.append(source.read())
    return concatenate([p for p in parts if len(p)])


@pytest.fixture
def terminal():
    """Our end of a pseudo terminal, and the name of the other."""
    ours, theirs = os.openpty()
    yield ours, os.ttyname(theirs)
    for end in (ours, theirs):
        os.close(end)


def test_lines_on_a_serial_port(terminal):
    pytest.importorskip("serial")
    ours, name = terminal
    source = opened(f"lines:{name},baudrate=115200,parity=N")
    before = time.time_ns()
    os.write(ours, b"1,2,3,4\r\n5,6")
    first = read_until(source, 1)
    os.write(ours, b",7,8\n\nhello\n")
    second = read_until(source, 2)
    assert [*first.texts, *second.texts] == [b"1,2,3,4", b"5,6,7,8", b"hello"]
    assert second.length.tolist() == [32, 0]
    assert abs(int(first.t_ns[0]) - before) < 60e9
    source.close()


def test_a_board_that_has_to_be_asked(terminal):
    pytest.importorskip("serial")
    ours, name = terminal
    os.set_blocking(ours, False)
    lines = LineFormat(columns=XYZT.columns, begin=("*RST", "RATE 10"), ask="?", end="\r")
    source = opened(f"lines:{name}", lines)
    asked = b""
    end = time.monotonic() + 20.0
    while not asked.endswith(b"?\r") and time.monotonic() < end:
        source.read()
        asked += _came(ours)
    assert asked == b"*RST\rRATE 10\r?\r"
    os.write(ours, b"1,2,3,4\n")
    assert read_until(source, 1).texts == (b"1,2,3,4",)
    source.read()
    assert _came(ours) == b"?\r"
    source.close()


def _came(ours):
    try:
        return os.read(ours, 100)
    except BlockingIOError:
        return b""


def test_noise_without_an_end_is_a_line_that_is_none(terminal):
    pytest.importorskip("serial")
    ours, name = terminal
    source = opened(f"lines:{name}")
    for _ in range(5):
        os.write(ours, b"\xff" * 1000)
        time.sleep(0.01)
    found = read_until(source, 1)
    assert found.length.tolist() == [0]
    assert len(found.texts[0]) > 4096
    source.close()


class LostError(Exception):
    """A library's own."""


class Plug:
    """A port that the test pulls and puts back."""

    def __init__(self):
        self.there, self.waiting, self.closed = True, [], 0

    def connect(self):
        if not self.there:
            raise RefusedError("tty0", "cannot be opened: no such device")
        return self

    def lines(self):
        if not self.there:
            raise LostError("device disconnected\nor multiple access")
        found, self.waiting = self.waiting, []
        return found

    def close(self):
        self.closed += 1


def test_a_port_that_goes_away_and_comes_back():
    from triaxcal.rig.sources.linesource import LineSource

    plug = Plug()
    source = LineSource("tty0", XYZT, plug.connect)
    plug.waiting = [b"1,2,3,4"]
    assert len(source.read()) == 1
    plug.there = False
    assert len(source.read()) == 0
    assert source.notes() == ["tty0: lost: device disconnected or multiple access"]
    assert len(source.read()) == 0
    assert plug.closed == 1
    plug.there, plug.waiting = True, [b"5,6,7,8"]
    assert read_until(source, 1).texts == (b"5,6,7,8",)
    assert source.notes() == ["tty0: it is back", "tty0: frames come again"]


def test_a_port_that_is_not_there(tmp_path):
    pytest.importorskip("serial")
    with pytest.raises(
        RefusedError, match=r"none0: cannot be opened: .*; serial ports: "
    ) as refusal:
        opened(f"lines:{tmp_path}/none0")
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("bus", "said"),
    [
        ("lines:/dev/ttyS0,baudrat=9600", r'baudrat\' \(did you mean "baudrate"\?\)'),
        ("lines:/dev/ttyS0,baudrate=fast", "found baudrate=fast; expected a number"),
        ("visa:GPIB0::22::INSTR,speed=3", "found 'speed'; expected visa:resource"),
        ("visa:GPIB0::22::INSTR,timeout=x", "timeout is no number"),
    ],
)
def test_options_that_there_are_not(bus, said):
    pytest.importorskip("serial")
    pytest.importorskip("pyvisa")
    with pytest.raises(UsageError, match=said):
        opened(bus)


def test_a_voltmeter_with_a_scanner():
    """The paper's own rig: three voltages and a thermometer, a line for each question."""
    pytest.importorskip("pyvisa_sim")
    lines = LineFormat(columns=("z", "y", "x", "temperature"), ask="READ? (@101:104)")
    source = opened(f"visa:GPIB::22::INSTR,library={SIMULATED}", lines)
    frames = read_until(source, 3)
    assert numbers(frames, 2) == [0.1, -0.55, 0.025, 1.234]
    assert frames.texts[0] == b"+1.00000E-01,-5.50000E-01,+2.50000E-02,+1.23400E+00"
    source.close()


def test_a_voltmeter_that_does_not_answer():
    pytest.importorskip("pyvisa_py")
    lines = LineFormat(columns=XYZT.columns, ask="READ?")
    with socket.create_server(("127.0.0.1", 0)) as deaf:
        port = deaf.getsockname()[1]
        source = opened(f"visa:TCPIP::127.0.0.1::{port}::SOCKET,timeout=0.2", lines)
        assert len(source.read()) == 0
        (note,) = source.notes()
        assert note.endswith("SOCKET, READ?: no answer within 0.2 s")
        source.close()
