"""A rig that speaks in lines goes through the pipeline of CAN, from description to replay."""

from __future__ import annotations

import os
import re
import threading
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from rig_cases import BENCH, SHORT_PLAN, bench_unit, play, rig_of, short_setup

from triaxcal.base.errors import RefusedError
from triaxcal.cli.rig import rig as rig_command
from triaxcal.rig.check.check import findings
from triaxcal.rig.description.lines import frames_of_lines
from triaxcal.rig.description.rigfile import read_description
from triaxcal.rig.logs.linelog import frames_of_log
from triaxcal.rig.plan.plan import read_plan
from triaxcal.rig.records.recording import JOURNAL_FILE, LOG_FILE, Recording
from triaxcal.rig.records.replay import replay
from triaxcal.rig.session.engine import Engine, Setup

VOLTS = """
format = 1
[lines]
columns = ["x", "y", "z", "degc"]
[signals]
x = "Line.x"
y = "Line.y"
z = "Line.z"
temperature = "Line.degc"
unit = "V"
temperature_unit = "degC"
"""
CODES = """
format = 1
[lines]
columns = ["count", "status", "x", "y", "z", "temp"]
separator = ";"
integers = ["x", "y", "z", "temp"]
counters = ["count", "status"]
[signals]
x = "Line.x"
y = "Line.y"
z = "Line.z"
temperature = "Line.temp"
[message.Line]
counter = "count"
counter_modulus = 256
status = "status"
"""


def lines_setup(folder: Path, description: str, temps="[20]") -> Setup:
    (folder / "rig.toml").write_text(description)
    plan = SHORT_PLAN.format(rate=100, layout="classic", temps=temps, take="false")
    (folder / "plan.toml").write_text(plan.replace('layout = "classic"', 'rig = "rig.toml"'))
    unit = bench_unit()
    setup = Setup(BENCH, unit, read_plan(folder / "plan.toml", unit), read_description(
        folder / "rig.toml"))  # fmt: skip
    setup.refuse_unfit()
    return setup


class Talker:
    """Says in lines what the simulated rig sends on CAN."""

    def __init__(self, folder, setup, text, *orders):
        folder.mkdir()
        can = short_setup(folder, temps="[20]")
        self.rig = rig_of(can, *orders)
        self._decoder = can.decoder()
        self._setup, self._text = setup, text
        self._temp = 0

    def texts(self):
        samples = self._decoder.feed(self.rig.advance())
        temps = dict(zip(samples.temp_number.tolist(), samples.temp_code.tolist(), strict=True))
        times, texts = [], []
        rows = zip(samples.number.tolist(), samples.t_ns.tolist(), samples.codes, strict=True)
        for number, t_ns, codes in rows:
            self._temp = temps.get(number, self._temp)
            times.append(t_ns)
            texts.append(self._text(number, codes.tolist(), self._temp).encode())
        return times, texts

    def advance(self):
        return frames_of_lines(self._setup.rig.lines, *self.texts())

    def __getattr__(self, name):
        return getattr(self.rig, name)

    def __setattr__(self, name, value):
        if name == "target_degc":
            self.rig.target_degc = value
        else:
            super().__setattr__(name, value)


def volts(number, codes, temp):
    del number
    unit = bench_unit()
    x, y, z = (code * unit.adc.volts_per_code for code in codes)
    return f"{x:.9f},{y:.9f},{z:.9f},{unit.temperature_sensor.degc(temp):.4f}"


def codes_of(number, codes, temp):
    return ";".join(map(str, (number % 256, 0, *codes, temp)))


@pytest.mark.long
@pytest.mark.parametrize(
    ("description", "text", "rounding_code"),
    [
        # 9 digits after the point: half of the last is 5e-10 V, of 2.5 V / 2^23 a code.
        (VOLTS, volts, 5e-10 / (2.5 / 2**23)),
        (CODES, codes_of, 0.0),
    ],
)
def test_a_session_on_lines_gives_what_the_session_on_can_gives(
    tmp_path, description, text, rounding_code
):
    can = short_setup(tmp_path, temps="[20]")
    exact = Engine(can, "can")
    play(rig_of(can), exact.feed, exact.session)
    setup = lines_setup(tmp_path, description)
    talker = Talker(tmp_path / "talker", setup, text)
    engine = Engine(setup, "lines")
    events = play(talker, engine.feed, engine.session)
    assert [e.text for e in events if e.kind == "trouble"] == []
    assert engine.session.accepted.keys() == exact.session.accepted.keys()
    for place, dwell in engine.session.accepted.items():
        mine, theirs = np.array(dwell.mean_code), np.array(exact.session.accepted[place].mean_code)
        assert np.abs(mine - theirs).max() <= rounding_code + 1e-6
        assert dwell.temp_degc == pytest.approx(exact.session.accepted[place].temp_degc, abs=6e-5)


@pytest.mark.parametrize(
    ("description", "text", "order", "said"),
    [
        (CODES, codes_of, "lose@82.1:160", r"7\d of 100 samples lost in 1 s"),
        (CODES, codes_of, "gone@82:1:4", r"gap of \d s"),
        (VOLTS, volts, "linkdown@82:1:4", r"gap of [34] s or more without samples"),
        (VOLTS, volts, "slip@84:150", r"TP1: slip of 1\d\d micro-g on x at \d+ s"),
    ],
)
def test_faults_are_found_on_lines_too(tmp_path, description, text, order, said):
    setup = lines_setup(tmp_path, description)
    talker = Talker(tmp_path / "talker", setup, text, order)
    engine = Engine(setup, "lines")
    events = play(talker, engine.feed, engine.session, accepted=1)
    assert any(re.search(said, e.text) for e in events if e.kind in {"refused", "trouble"}), events


def test_lines_that_are_none_are_counted(tmp_path):
    setup = lines_setup(tmp_path, VOLTS)
    talker = Talker(tmp_path / "talker", setup, volts)
    decoder = setup.decoder()
    times, texts = talker.texts()
    texts[3], texts[5] = b"#READY", texts[5].replace(b",", b",-", 1).replace(b"--", b"-") + b",1"
    texts[7] = b"ovld," + texts[7].partition(b",")[2]
    samples = decoder.feed(frames_of_lines(setup.rig.lines, times, texts))
    assert len(samples.number) == 97
    assert sorted(samples.trouble.tolist()) == [1, 1, 5 - 1]  # two of another form, one no number


@pytest.mark.long
def test_a_recorded_session_is_replayed_from_its_lines(tmp_path):
    """SIGKILL in the middle, as far as the files know; then go on, and replay all."""
    setup = lines_setup(tmp_path, CODES)
    talker = Talker(tmp_path / "talker", setup, codes_of)
    session = tmp_path / "session"
    taken = Recording(setup, session, "/dev/ttyUSB0")
    play(talker, taken.feed, taken.engine.session, accepted=2)
    taken.close()
    log = session / LOG_FILE
    first = log.read_text().splitlines()[0]
    assert first.startswith("(1700000000.")
    assert " /dev/ttyUSB0 0;0;" in first
    with log.open("ab") as torn:
        torn.write(b"(1700000300.12")
    taken = Recording(setup, session, "/dev/ttyUSB0")
    assert taken.resumed
    assert len(taken.engine.session.accepted) == 2
    play(talker, taken.feed, taken.engine.session)
    taken.log.flush(sync=True)
    taken.close()
    played = replay(setup, log, session / JOURNAL_FILE)
    assert played.engine.session.accepted == taken.engine.session.accepted
    assert played.notes == ()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("[signals]", '[rig]\nfile = "a.dbc"\n[signals]'), r"\[rig\]: stands beside \[lines\]"),
        (('"degc"]', '"x"]'), r"\[lines\] columns: found .* at most 8 different names"),
        (('"degc"]', '"degc"]\nintegers = ["n"]'), r"integers: found .* names of columns; n is no"),
        (('"Line.x"', '"Line.xx"'), r"\[signals\] x: no signal 'Line.xx'; nearest: Line.x"),
        (('unit = "V"', 'unit = "bar"'), r"its unit is 'bar'"),
        (('unit = "V"\n', ""), r"its value is recorded, and nothing says its unit"),
        (('columns = ["x", "y", "z", "degc"]', 'colums = ["x"]'), r"missing: \[lines\] columns"),
        (("[lines]\ncolumns", "[rig]\n#"), r"\[rig\] file: missing; expected a bus descript"),
    ],
)  # fmt: skip
def test_a_wrong_description_is_refused(tmp_path, change, said):
    assert change[0] in VOLTS
    with pytest.raises(RefusedError, match=said):
        lines_setup(tmp_path, VOLTS.replace(*change))


def invoke(folder, *arguments):
    options = ["--unit", str(BENCH), "--plan", str(folder / "plan.toml")]
    return CliRunner().invoke(rig_command, [*arguments, *options])


@pytest.mark.parametrize("bus", ["can0", "virtual", "pcan:PCAN_USBBUS1"])
def test_a_bus_is_refused_for_a_rig_that_speaks_lines(tmp_path, bus):
    lines_setup(tmp_path, VOLTS)
    done = invoke(tmp_path, "check", "--bus", bus)
    assert isinstance(done.exception, RefusedError)
    assert "gives frames; expected what " in str(done.exception)
    assert "lines:port,option=value, visa:resource" in str(done.exception)


def test_a_rig_that_speaks_lines_is_not_simulated_on_a_bus(tmp_path):
    lines_setup(tmp_path, CODES)
    done = invoke(tmp_path, "simulate", "--bus", "virtual:x", "--seconds", "1")
    assert "gives frames; expected what" in str(done.exception)


def test_lines_are_refused_for_a_rig_on_can(tmp_path):
    short_setup(tmp_path)
    (tmp_path / "short.toml").rename(tmp_path / "plan.toml")
    done = invoke(tmp_path, "check", "--bus", "lines:/dev/ttyUSB0")
    said = "--bus lines:port,option=value: gives lines; expected what tilter describes: virtual"
    assert str(done.exception).startswith(said)


def test_lines_of_a_terminal_are_checked_and_recorded(tmp_path):
    """The command line on a pseudo terminal, as on a board's port."""
    pytest.importorskip("serial")
    setup = lines_setup(tmp_path, CODES)
    talker = Talker(tmp_path / "talker", setup, codes_of)
    lines = [text + b"\r\n" for _ in range(4) for text in talker.texts()[1]]
    ours, theirs = os.openpty()
    stop = threading.Event()

    def says():
        for text in lines:
            if stop.wait(0.01):
                return
            os.write(ours, text)

    thread = threading.Thread(target=says)
    thread.start()
    log = tmp_path / "frames.log"
    try:
        bus = f"lines:{os.ttyname(theirs)},baudrate=115200"
        done = invoke(tmp_path, "record", "--bus", bus, "--seconds", "1.5", str(log))
    finally:
        stop.set()
        thread.join(20)
        os.close(ours)
        os.close(theirs)
    assert done.exit_code == 0, done.output
    kept = log.read_bytes().splitlines()
    assert len(kept) >= 10
    sent = [text.strip() for text in lines]
    first = sent.index(kept[0].split(b" ", 2)[2])
    assert [line.split(b" ", 2)[2] for line in kept] == sent[first : first + len(kept)]
    (parsed,) = frames_of_log(log, setup.rig.lines)
    found = {f.text: f.good for f in findings(setup, parsed.frames, "log", [])}
    assert found["0 frames with a wrong CRC or length"]
    assert found["IDs that are not the rig's: none"]
