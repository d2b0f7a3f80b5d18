"""Durability: what was acknowledged is there, what is not sure is not accepted."""

from __future__ import annotations

import hashlib
import os
import resource
import subprocess
import sys
from dataclasses import asdict, replace

import numpy as np
import pytest
from rig_cases import play, rig_of, short_setup

from triaxcal.base.errors import RefusedError
from triaxcal.readings.measurements import read_measurements
from triaxcal.rig.live.runner import Robot
from triaxcal.rig.records.journal import Journal, read_journal
from triaxcal.rig.records.rawlog import RawLog
from triaxcal.rig.records.recording import (
    JOURNAL_FILE,
    LOG_FILE,
    Recording,
    durable_events,
    header,
    refuse_other_session,
)
from triaxcal.rig.records.replay import replay
from triaxcal.rig.records.store import write_records
from triaxcal.rig.session.events import Redo


def session(setup, folder, *orders):
    taken = Recording(setup, folder, "test")
    events = play(rig_of(setup, *orders), taken.feed, taken.engine.session)
    taken.close()
    return taken, events


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recorded")
    setup = short_setup(folder, temps="[20]")
    taken, _ = session(setup, folder / "001", "slip@84:150", "twonodes@130:1:3", "bitflip@170:9")
    return setup, folder / "001", taken


def test_a_replay_gives_the_same_bytes(recorded, tmp_path):
    setup, folder, taken = recorded
    live, again = tmp_path / "live", tmp_path / "again"
    live.mkdir()
    again.mkdir()
    write_records(live, taken.engine.session, setup.rig, taken.log.state)
    played = replay(setup, folder / LOG_FILE, folder / JOURNAL_FILE)
    write_records(again, played.engine.session, setup.rig, played.log)
    for name in ("measurements.csv", "measurements.json"):
        assert (live / name).read_bytes() == (again / name).read_bytes()


def test_the_fit_gets_u_as_the_variance_of_the_mean(recorded, tmp_path):
    setup, _, taken = recorded
    write_records(tmp_path, taken.engine.session, setup.rig, taken.log.state)
    read = read_measurements(tmp_path / "measurements.csv", setup.unit)
    for row, dwell in zip(read.dwells, taken.engine.session.accepted.values(), strict=True):
        u_v = np.array(dwell.u_code) * setup.unit.adc.volts_per_code
        np.testing.assert_allclose(np.sqrt(row.variance_of_mean_v2), u_v, rtol=1e-12)


@pytest.mark.parametrize("step", [13, pytest.param(1, marks=pytest.mark.slow)])
def test_a_journal_cut_anywhere_keeps_what_came_before(recorded, tmp_path, step):
    _, folder, _ = recorded
    text = (folder / JOURNAL_FILE).read_bytes()
    whole = read_journal(folder / JOURNAL_FILE).records
    ends = [i + 1 for i, byte in enumerate(text) if byte == ord("\n")]
    path = tmp_path / "cut"
    for size in {*range(0, len(text) + 1, step), *ends, *(end - 1 for end in ends)}:
        path.write_bytes(text[:size])
        found = read_journal(path)
        assert found.records == whole[: sum(end <= size for end in ends)]
        assert not found.damaged
        assert found.torn == (size not in {0, *ends})


@pytest.mark.parametrize("count", [300, pytest.param(10_000, marks=pytest.mark.slow)])
def test_no_bit_flip_in_the_journal_is_believed(recorded, tmp_path, count):
    _, folder, _ = recorded
    text = (folder / JOURNAL_FILE).read_bytes()
    whole = read_journal(folder / JOURNAL_FILE).records
    rng = np.random.default_rng(11)
    path = tmp_path / "flipped"
    for bit in rng.integers(0, 8 * len(text), count).tolist():
        spoiled = bytearray(text)
        spoiled[bit // 8] ^= 1 << bit % 8
        path.write_bytes(spoiled)
        found = read_journal(path)
        assert found.records == whole[: len(found.records)]
        assert len(found.records) == text[: bit // 8].count(b"\n")
        assert found.torn or found.damaged


def test_a_damaged_journal_is_not_gone_on_with(recorded, tmp_path):
    _, folder, _ = recorded
    spoiled = bytearray((folder / JOURNAL_FILE).read_bytes())
    spoiled[200] ^= 4
    path = tmp_path / JOURNAL_FILE
    path.write_bytes(spoiled)
    with pytest.raises(RefusedError, match="damaged behind its 0 good records"):
        Journal(path)
    assert path.read_bytes() == spoiled


@pytest.mark.parametrize("count", [20, pytest.param(10_000, marks=pytest.mark.slow)])
def test_no_bit_flip_and_no_cut_of_the_log_is_believed(recorded, tmp_path, count):
    """Beside its journal a changed log is refused; what was accepted stands in the journal."""
    setup, folder, _ = recorded
    text = (folder / LOG_FILE).read_bytes()
    rng = np.random.default_rng(12)
    path = tmp_path / LOG_FILE
    path.write_bytes(text)
    known = int(read_journal(folder / JOURNAL_FILE).records[-1]["log"]["bytes"])
    with path.open("r+b") as file:
        for bit in rng.integers(0, 8 * known, count).tolist():
            for byte in (text[bit // 8] ^ 1 << bit % 8, text[bit // 8]):
                file.seek(bit // 8)
                file.write(bytes([byte]))
                file.flush()
                if byte != text[bit // 8]:
                    with pytest.raises(RefusedError, match="as the journal recorded"):
                        replay(setup, path, folder / JOURNAL_FILE)
    for size in sorted(rng.integers(0, known, count // 20).tolist(), reverse=True):
        os.truncate(path, size)
        with pytest.raises(RefusedError, match="as the journal recorded"):
            replay(setup, path, folder / JOURNAL_FILE)


def test_a_resumed_session_notices_a_log_that_was_cut_or_changed(recorded, tmp_path):
    setup, folder, _ = recorded
    for name in (LOG_FILE, JOURNAL_FILE):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    text = (folder / LOG_FILE).read_bytes()
    spoiled = bytearray(text)
    spoiled[1000] ^= 1
    (tmp_path / LOG_FILE).write_bytes(spoiled)
    with pytest.raises(RefusedError, match=r"its first .* bytes have SHA-256 .*as the journal"):
        Recording(setup, tmp_path, "test").log.flush()
    os.truncate(tmp_path / LOG_FILE, 1000)
    with pytest.raises(RefusedError, match=r"frames\.log: it has 1000 bytes; expected \d+ or more"):
        Recording(setup, tmp_path, "test")


def test_an_event_after_a_resume_waits_for_no_hash(tmp_path, monkeypatch):
    path = tmp_path / LOG_FILE
    path.write_bytes(b"(1.000000) test 123#00\n" * 200_000)  # 4.4 MB, four reads
    monkeypatch.setattr("triaxcal.rig.records.rawlog._HASH_BYTES", 1 << 20)
    log = RawLog(path, "test")
    states = [log.state for _ in range(5)]
    assert ["sha256" in s for s in states] == [False, False, False, False, True]
    assert {k: states[0][k] for k in ("lines", "bytes")} == {"lines": 200_000, "bytes": 4_600_000}
    assert states[4]["sha256"] == hashlib.sha256(path.read_bytes()).hexdigest()
    log.close()


def test_a_log_cut_while_it_is_open_is_told(tmp_path):
    path = tmp_path / LOG_FILE
    path.write_bytes(b"(1.000000) test 123#00\n" * 1000)
    log = RawLog(path, "test")
    os.truncate(path, 230)
    with pytest.raises(RefusedError, match=r"it ends at byte 230; expected 23000 bytes; the log"):
        log.close()


@pytest.mark.parametrize("size", [1, 1000, 1 << 20])
def test_the_hash_of_a_log_is_that_of_its_bytes(tmp_path, monkeypatch, size):
    """Also when it is made little by little, and from a known beginning."""
    monkeypatch.setattr("triaxcal.rig.records.rawlog._HASH_BYTES", size)
    rig = rig_of(short_setup(tmp_path))
    path, known = tmp_path / LOG_FILE, None
    for _ in range(3):
        log = RawLog(path, "test", known)
        for _ in range(3):
            log.append(rig.advance())
            log.flush()
        while "sha256" not in log.state:
            assert log.state.keys() <= {"lines", "bytes", "sha256"}
        known = log.state
        log.close()
        text = path.read_bytes()
        sha256 = hashlib.sha256(text).hexdigest()
        assert known == {"lines": text.count(b"\n"), "bytes": len(text), "sha256": sha256}
        with path.open("ab") as file:
            file.write(b"(17000")


@pytest.mark.parametrize("count", [3, pytest.param(60, marks=pytest.mark.slow)])
def test_a_flipped_payload_in_a_log_without_journal_changes_no_mean(recorded, tmp_path, count):
    """The CRC takes the sample out; a mean then moves by no more than a sample's share."""
    setup, folder, taken = recorded
    text = (folder / LOG_FILE).read_bytes()
    rng = np.random.default_rng(13)
    path = tmp_path / LOG_FILE
    line_starts = [i + 1 for i, byte in enumerate(text) if byte == ord("\n")][:-1]
    for start in rng.choice(line_starts, count).tolist():
        at = text.index(b"#", start) + 1 + int(rng.integers(16))
        spoiled = bytearray(text)
        spoiled[at] = ord("0") if spoiled[at] != ord("0") else ord("1")
        path.write_bytes(spoiled)
        played = replay(setup, path)
        for key, dwell in played.engine.session.accepted.items():
            there = taken.engine.session.accepted[key]
            # One of 2000 readings, none of them further off than 6 sd of 141 micro-g, 260 codes.
            assert np.abs(np.subtract(dwell.mean_code, there.mean_code)).max() < 6 * 260 / 1999


def test_a_log_of_another_unit_is_refused(recorded):
    setup, folder, _ = recorded
    unit = type(setup.unit)(**{**_fields(setup.unit), "serial": "OTHER-7"})
    other = type(setup)(setup.folder, unit, setup.plan, setup.rig)
    with pytest.raises(RefusedError, match=r"serial: found AT-SIM-BENCH-001; expected OTHER-7"):
        replay(other, folder / LOG_FILE, folder / JOURNAL_FILE)
    with pytest.raises(RefusedError, match=r'serial number .*AT-SIM-BENCH-001.*expected "OTHER-7"'):
        replay(other, folder / LOG_FILE)


def _fields(unit):
    return {name: getattr(unit, name) for name in unit.__dataclass_fields__}


@pytest.mark.parametrize("stop_s", [30, 70, 105, 106, 200])
def test_a_stopped_session_is_resumed_and_replayed_alike(tmp_path, stop_s):
    setup = short_setup(tmp_path, temps="[20]")
    rig, folder = rig_of(setup), tmp_path / "001"
    taken = Recording(setup, folder, "test")
    robot = Robot(rig)
    acknowledged = []
    for _ in range(stop_s):
        acknowledged += [e for e in taken.feed(rig.advance()) if e.kind == "accepted"]
        robot.act(taken.engine.session)
    # As a crash leaves it: nothing closed, half a line at the end of either file. The lock ends
    # with its process.
    taken.log.flush()
    taken.lock.close()
    for name in (LOG_FILE, JOURNAL_FILE):
        with (folder / name).open("ab") as file:
            file.write(b"(1700000000.1234")
    for _ in range(7):
        rig.advance()
    again = Recording(setup, folder, "test")
    kept = [e.dwell for e in durable_events(read_journal(folder / JOURNAL_FILE).records) if e.dwell]
    assert kept == [e.dwell for e in acknowledged]
    play(rig, again.feed, again.engine.session)
    again.close()
    played = replay(setup, folder / LOG_FILE, folder / JOURNAL_FILE)
    assert played.engine.session.accepted == again.engine.session.accepted
    assert len(again.engine.session.accepted) == 6


def test_the_operators_words_are_replayed(tmp_path):
    setup = short_setup(tmp_path, temps="[20]")
    rig, folder = rig_of(setup), tmp_path / "001"
    taken = Recording(setup, folder, "test")
    robot = Robot(rig)
    while not taken.engine.session.done:
        taken.feed(rig.advance())
        if rig.seconds in {150, 151}:
            taken.command(Redo("TP1"), rig.seconds * 10**9)
        robot.act(taken.engine.session)
    taken.close()
    assert taken.engine.session.accepted[0, "TP1"].start_ns > 150 * 10**9
    played = replay(setup, folder / LOG_FILE, folder / JOURNAL_FILE)
    assert list(map(asdict, played.engine.session.accepted.values())) == list(
        map(asdict, taken.engine.session.accepted.values())
    )


@pytest.mark.parametrize("limit", [0, 100, 60_000, 700_000])
def test_a_full_disk_ends_the_session_with_an_intact_prefix(tmp_path, limit):
    """A limit on the size of files stands for a full disk: writes fail in the same place."""
    script = (
        "import resource, signal, sys; from pathlib import Path\n"
        "sys.path[:0] = [sys.argv[3]]\n"
        "from rig_cases import *; from triaxcal.rig.records.recording import Recording\n"
        "from triaxcal.base.errors import RefusedError\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "folder = Path(sys.argv[1]); setup = short_setup(folder, temps='[20]')\n"
        "n = int(sys.argv[2]); resource.setrlimit(resource.RLIMIT_FSIZE, (n, n))\n"
        "try:\n"
        "    taken = Recording(setup, folder / '001', 'test')\n"
        "    play(rig_of(setup), taken.feed, taken.engine.session)\n"
        "except RefusedError as refusal:\n"
        "    print(refusal); sys.exit(refusal.exit_code)\n"
    )
    here = str(__import__("pathlib").Path(__file__).parent)
    command = [sys.executable, "-c", script, str(tmp_path), str(limit), here]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1, done.stderr
    assert "cannot be written: file too large" in done.stdout
    assert len(done.stdout.splitlines()) == 1
    if limit == 0:  # not even the lock
        assert list((tmp_path / "001").iterdir()) == []
        return
    log = (tmp_path / "001" / LOG_FILE).read_bytes()
    assert not log or log.endswith(b"\n")
    found = read_journal(tmp_path / "001" / JOURNAL_FILE)
    assert not found.torn
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] != limit


def test_a_clock_set_back_does_not_hold_up_decisions(tmp_path, monkeypatch):
    setup = short_setup(tmp_path, temps="[20]")
    frames = rig_of(setup).advance()
    few = frames.take(slice(4))
    taken = Recording(setup, tmp_path / "001", "test")
    decided = []
    monkeypatch.setattr(taken.engine, "feed", lambda frames: decided.append(len(frames)) or [])
    taken.feed(few)
    assert decided == []  # too little time to decide anything
    taken.feed(replace(few, t_ns=few.t_ns - 3600 * 10**9))
    assert decided == [8]
    taken.close()


def test_a_journal_of_before_rig_descriptions_is_gone_on_with(tmp_path):
    setup = short_setup(tmp_path, temps="[20]")
    old = {k: v for k, v in header(setup).items() if k not in {"rig", "rig_sha256", "undetected"}}
    refuse_other_session(tmp_path / "x", old, setup)
    with pytest.raises(RefusedError, match="rig_sha256"):
        refuse_other_session(tmp_path / "x", {**header(setup), "rig_sha256": "0"}, setup)
    with pytest.raises(RefusedError, match="dbc_sha256"):
        refuse_other_session(tmp_path / "x", {**old, "dbc_sha256": "0"}, setup)
