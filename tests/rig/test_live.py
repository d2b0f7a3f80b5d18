"""The live commands: keys on a terminal, `rig record`, `rig simulate`, python-can's other buses."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import select
import struct
import subprocess
import sys
import termios
import threading
import time
from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from rig_cases import rig_of, short_setup
from test_cli_rig import bench_copy, triaxcal

from triaxcal.base.errors import RefusedError
from triaxcal.cli.rig import rig
from triaxcal.rig.bus.frames import empty
from triaxcal.rig.bus.messages import messages_of
from triaxcal.rig.bus.openbus import open_bus
from triaxcal.rig.check.check import findings
from triaxcal.rig.live.runner import live
from triaxcal.rig.logs.candump import parse
from triaxcal.rig.records.journal import read_journal
from triaxcal.rig.records.recording import JOURNAL_FILE, Recording
from triaxcal.rig.sources.canbus import BusSource

ENTRY = "from triaxcal.cli.entry import entry; entry()"
CHANNELS = count(1)
LIMIT_S = 60.0


class Terminal:
    """A session on a terminal of 80x24."""

    def __init__(self, arguments):
        self.end, theirs = pty.openpty()
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
        environment = {**os.environ, "TERM": "xterm-256color", "COLUMNS": "80", "LINES": "24"}
        self.process = subprocess.Popen(
            [sys.executable, "-c", ENTRY, *map(str, arguments)],
            stdin=theirs, stdout=theirs, stderr=theirs, env=environment, start_new_session=True,
        )  # fmt: skip
        os.close(theirs)
        self.text = ""

    def until(self, said):
        end = time.monotonic() + LIMIT_S
        while said() is False and time.monotonic() < end:
            if select.select([self.end], [], [], 0.05)[0]:
                try:
                    self.text += os.read(self.end, 65536).decode("utf-8", "replace")
                except OSError:  # the other side has gone
                    break
        assert said(), self.text[-2000:]

    def close(self):
        self.process.kill()
        self.process.wait()
        os.close(self.end)


def test_the_operators_keys(tmp_path):
    unit, setup = bench_copy(tmp_path), short_setup(tmp_path, temps="[20]")
    terminal = Terminal(["rig", "run", "--bus", "virtual", "--unit", unit,
                         "--plan", setup.plan.source])  # fmt: skip
    journal = unit / "sessions" / "001" / JOURNAL_FILE

    def commands():
        records = read_journal(journal).records if journal.exists() else ()
        return [r["command"]["name"] for r in records if r["kind"] == "command"]

    try:
        terminal.until(lambda: "\x1b[?1049h" in terminal.text and "█" in terminal.text)
        # An arrow key, an unknown one; then two in one go.
        os.write(terminal.end, b"\x1b[1~")
        os.write(terminal.end, b"x")
        os.write(terminal.end, b"y1")
        terminal.until(lambda: len(commands()) >= 2)
        os.write(terminal.end, b"q")
        terminal.until(lambda: "go on with: triaxcal rig resume" in terminal.text)
        assert terminal.process.wait(LIMIT_S) == 1
    finally:
        terminal.close()
    assert commands() == ["Agree", "Redo"]
    texts = [r["event"]["text"] for r in read_journal(journal).records if r["kind"] == "event"]
    assert "no position is offered" in texts
    assert "TP1 has not been accepted at this temperature" in texts
    # The terminal is as before: the other screen left, the cursor shown.
    assert terminal.text.rindex("\x1b[?1049l") > terminal.text.rindex("\x1b[?1049h")
    assert terminal.text.rindex("\x1b[?25h") > terminal.text.rindex("\x1b[?25l")


@pytest.mark.slow
def test_ctrl_c_stops_a_session_like_q(tmp_path):
    unit, setup = bench_copy(tmp_path), short_setup(tmp_path, temps="[20]")
    terminal = Terminal(["rig", "run", "--bus", "virtual", "--unit", unit, "--plain",
                         "--plan", setup.plan.source])  # fmt: skip
    try:
        terminal.until(lambda: "reference: noise at rest learned" in terminal.text)
        terminal.process.send_signal(2)
        terminal.until(lambda: "go on with: triaxcal rig resume" in terminal.text)
        assert terminal.process.wait(LIMIT_S) == 1
    finally:
        terminal.close()
    assert "Traceback" not in terminal.text


def test_a_recorded_bus_is_the_simulated_one(tmp_path):
    """`rig simulate` at one end of a python-can channel, `rig record` at the other."""
    setup = short_setup(tmp_path)
    channel, log = f"virtual:live-{next(CHANNELS)}", tmp_path / "x.log"
    common = ["--unit", str(setup.folder), "--plan", setup.plan.source, "--bus", channel]

    def record():
        rig.main(["record", *common, "--seconds", "3", str(log)], standalone_mode=False)

    recorder = threading.Thread(target=record)
    recorder.start()
    end = time.monotonic() + LIMIT_S
    while not log.exists() and time.monotonic() < end:
        time.sleep(0.01)
    rig.main(["simulate", *common, "--seconds", "2"], standalone_mode=False)
    recorder.join(LIMIT_S)
    assert not recorder.is_alive()
    parsed = parse(log.read_bytes())
    assert parsed.bad_lines == 0
    alone = rig_of(setup)
    sent = [alone.advance() for _ in range(2)]
    codes = [setup.decoder().feed(f).codes for f in (parsed.frames,)]
    decoder = setup.decoder()
    expected = np.concatenate([decoder.feed(frames).codes for frames in sent])
    # The recorder may have come to the channel some frames late, never lost one in between.
    assert len(codes[0]) > 100
    np.testing.assert_array_equal(codes[0], expected[-len(codes[0]) :])


def test_record_goes_on_behind_what_is_there(tmp_path):
    unit, setup = bench_copy(tmp_path), short_setup(tmp_path)
    log = tmp_path / "x.log"
    log.write_bytes(b"(1600000000.000000) can0 100#00\n(160000")
    done = triaxcal("rig", "record", "--bus", "virtual", "--unit", unit, "--seconds", "0.2",
                    "--plan", setup.plan.source, log)  # fmt: skip
    assert done.returncode == 0, done.stderr
    lines = log.read_bytes().splitlines()
    assert lines[0] == b"(1600000000.000000) can0 100#00"
    assert f"{log}: {len(lines) - 1} frames" in done.stdout
    assert parse(log.read_bytes()).bad_lines == 0


def test_a_bus_gets_python_cans_own_configuration(monkeypatch):
    monkeypatch.setenv("CAN_CONFIG", '{"receive_own_messages": true}')
    bus = open_bus(f"virtual:live-{next(CHANNELS)}", fd=False)
    assert bus.receive_own_messages
    bus.shutdown()


@pytest.mark.parametrize("layout", ["classic", "fd"])
def test_frames_over_a_bus_of_python_can(tmp_path, layout):
    setup = short_setup(tmp_path, layout=layout)
    name = f"virtual:live-{next(CHANNELS)}"
    sender = open_bus(name, fd=layout == "fd")
    source = BusSource(open_bus(name, fd=layout == "fd"), name)
    frames = rig_of(setup).advance()
    for message in messages_of(frames):
        sender.send(message)
    found, end = source.read(), time.monotonic() + LIMIT_S
    while not len(found) and time.monotonic() < end:
        found = source.read()
    np.testing.assert_array_equal(found.can_id, frames.can_id)
    np.testing.assert_array_equal(found.data[:, :8], frames.data[:, :8])
    assert source.notes() == []
    while not (notes := source.notes()) and time.monotonic() < end:
        source.read()
    assert notes == [f"{name}: no frames; is the rig on, the plug in, the bus up?"]
    sender.send(messages_of(frames)[0])
    while not (notes := source.notes()) and time.monotonic() < end:
        source.read()
    assert notes == [f"{name}: frames come again"]
    source.close()
    sender.shutdown()


def test_a_bus_that_breaks_is_told():
    name = f"virtual:live-{next(CHANNELS)}"
    bus = open_bus(name, fd=False)
    bus.shutdown()
    with pytest.raises(RefusedError, match=f"{name}: cannot be read: .*`triaxcal rig resume`"):
        BusSource(bus, name).read()


class Given:
    """A source of given frames, the same second again and again."""

    name = "given"

    def __init__(self, frames):
        self.frames, self.seconds = frames, 0

    def read(self):
        self.seconds += 1
        late = self.frames.t_ns + self.seconds * 10**9
        return replace(self.frames, t_ns=late)

    def notes(self):
        return []

    def close(self):
        pass


def under_other_ids(frames):
    return replace(frames, can_id=frames.can_id + np.uint32(0x40))


def test_frames_of_another_dbc_are_told_in_a_session(tmp_path, monkeypatch):
    monkeypatch.setattr("triaxcal.rig.live.runner._NOT_DECODED_S", 0.0)
    setup = short_setup(tmp_path)
    taken = Recording(setup, tmp_path / "001", "given")
    source = Given(under_other_ids(rig_of(setup).advance()))
    notes = [note for tick, _ in zip(live(taken, source, list), range(20), strict=False)
             for note in tick.notes]  # fmt: skip
    taken.close()
    assert len(notes) == 1
    assert re.fullmatch(
        r"\d+ frames and no sample among them: wrong DBC or layout, another rig, or two nodes with "
        r"one ID; try `triaxcal rig check`",
        notes[0],
    )


def test_check_names_the_ids_of_another_dbc(tmp_path):
    setup = short_setup(tmp_path)
    frames = under_other_ids(rig_of(setup).advance())
    texts = {f.text: f.good for f in findings(setup, frames, "given", [])}
    assert texts["IDs that are not the rig's: 0x140, 0x141, 0x142, 0x143"]
    assert not texts["the rig has not sent its serial number (RIG_IDENT)"]
    assert not texts["211 frames, 0 samples: wrong rig description, or another rig"]


def test_check_of_silence(tmp_path):
    (found,) = findings(short_setup(tmp_path), empty(), "given", [])
    assert (found.good, found.text) == (False, "given: no frames at all")
