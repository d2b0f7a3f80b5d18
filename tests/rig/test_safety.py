"""The folder of a session: one process at a time, damage mended, nothing replaced silently."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from rig_cases import play, rig_of, short_setup
from test_cli_rig import bench_copy, triaxcal

from triaxcal.base import durable
from triaxcal.base.errors import RefusedError
from triaxcal.base.publish import publish, publish_beside
from triaxcal.rig.live.runner import Robot
from triaxcal.rig.plan.plan import read_plan
from triaxcal.rig.records.journal import Journal, read_journal
from triaxcal.rig.records.lock import Lock
from triaxcal.rig.records.mend import damage, mend
from triaxcal.rig.records.recording import (
    JOURNAL_FILE,
    LOCK_FILE,
    LOG_FILE,
    Recording,
    durable_events,
)
from triaxcal.rig.records.replay import replay
from triaxcal.rig.records.store import write_records
from triaxcal.rig.session.engine import Setup
from triaxcal.rig.session.events import Redo

# ---- One process a folder ----

HOLD = """
import sys
for name in {absent}:
    sys.modules[name] = None
from pathlib import Path
from triaxcal.rig.records.lock import Lock
lock = Lock(Path(sys.argv[1]), "a session")
print(lock.left_by, flush=True)
sys.stdin.read()
"""
WAYS = [(), ("fcntl",)]
"""With the system's lock of an open file, and without."""


def holding(path, absent=()):
    command = [sys.executable, "-c", HOLD.format(absent=absent), str(path)]
    process = subprocess.Popen(command, stdin=-1, stdout=-1, stderr=-1, text=True)
    assert process.stdout is not None
    return process, process.stdout.readline().strip()


@pytest.mark.parametrize("absent", WAYS)
def test_a_second_process_is_refused_with_the_first_ones_number_and_start(
    tmp_path, absent, monkeypatch
):
    path = tmp_path / LOCK_FILE
    process, said = holding(path, absent)
    for name in absent:
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(RefusedError) as refusal:
        Lock(path, "a session")
    process.communicate("")
    assert said == "None"
    assert refusal.value.place == str(tmp_path)
    started = r"started 20\d\d-\d\d-\d\d \d\d:\d\d:\d\d UTC"
    assert re.fullmatch(
        rf"a session is under way in process {process.pid}, {started}", refusal.value.found
    )
    with Lock(path, "a session") as lock:
        assert path.exists()
        assert lock.left_by is not None  # it ended without letting go
    assert list(tmp_path.iterdir()) == []


def test_a_lock_that_was_let_go_of_leaves_nothing(tmp_path):
    Lock(tmp_path / LOCK_FILE, "a session").close()
    assert list(tmp_path.iterdir()) == []
    with Lock(tmp_path / LOCK_FILE, "a session") as lock:
        assert lock.left_by is None


@pytest.mark.parametrize("absent", WAYS)
def test_the_lock_of_a_killed_process_is_taken_over(tmp_path, absent, monkeypatch):
    path = tmp_path / LOCK_FILE
    process, _ = holding(path, absent)
    process.kill()
    process.communicate()
    for name in absent:
        monkeypatch.setitem(sys.modules, name, None)
    with Lock(path, "a session") as lock:
        assert lock.left_by is not None
        assert lock.left_by.pid == process.pid
        with pytest.raises(RefusedError, match=f"in process {os.getpid()}, started"):
            Lock(path, "a session")
    assert list(tmp_path.iterdir()) == []


def test_a_lock_of_another_machine_is_not_taken_over(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "fcntl", None)
    path = tmp_path / LOCK_FILE
    path.write_text(json.dumps({"pid": 999_999_999, "since": "2026-01-01", "host": "elsewhere"}))
    with pytest.raises(RefusedError, match="process 999999999 on elsewhere, started 2026-01-01"):
        Lock(path, "a session")
    assert [p.name for p in tmp_path.iterdir()] == [LOCK_FILE]


@pytest.mark.long
def test_two_processes_on_one_session(tmp_path):
    """The second is refused and changes nothing; after a kill the third takes over."""
    unit = bench_copy(tmp_path)
    setup = short_setup(tmp_path, temps="[20]")
    common = ("--bus", "virtual", "--plain", "--unit", unit, "--plan", setup.plan.source)
    program = "from triaxcal.cli.entry import entry; entry()"
    command = [sys.executable, "-u", "-c", program, "rig", "run", *map(str, common)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as first:
        assert first.stdout is not None
        first.stdout.readline()
        os.kill(first.pid, signal.SIGSTOP)
        session = unit / "sessions" / "001"
        before = {p.name: p.read_bytes() for p in session.iterdir()}
        refused = [triaxcal("rig", word, *common) for word in ("resume", "run")]
        assert {p.name: p.read_bytes() for p in session.iterdir()} == before
        assert [p.name for p in (unit / "sessions").iterdir()] == ["001"]
        first.kill()
    for second in refused:
        assert second.returncode == 1
        assert re.fullmatch(
            rf"triaxcal: {session}: a session is under way in process {first.pid}, started .* UTC; "
            r"expected one process; wait for it, or end it\n",
            second.stderr,
        )
    third = triaxcal("rig", "resume", *common)
    assert third.returncode == 0, third.stderr
    assert f"taken over from process {first.pid}, started " in third.stdout
    assert not (session / LOCK_FILE).exists()


# ---- Damage ----


@pytest.fixture(scope="module")
def unfinished(tmp_path_factory):
    """A session of six positions that was cut after four; its folder, and what it had shown."""
    folder = tmp_path_factory.mktemp("unfinished")
    setup = short_setup(folder, temps="[20]")
    taken = Recording(setup, folder / "001", "test")
    play(rig_of(setup), taken.feed, taken.engine.session, accepted=4)
    taken.close()
    return setup, folder / "001", dict(taken.engine.session.accepted)


def copied(folder, target, journal):
    target.mkdir()
    (target / LOG_FILE).write_bytes((folder / LOG_FILE).read_bytes())
    (target / JOURNAL_FILE).write_bytes(journal)
    return target


def kept_dwells(folder):
    records = read_journal(folder / JOURNAL_FILE).records
    return {(e.dwell.step, e.dwell.position): e.dwell for e in durable_events(records) if e.dwell}


@pytest.mark.parametrize("count", [8, pytest.param(300, marks=pytest.mark.slow)])
def test_a_bit_flipped_anywhere_costs_no_accepted_dwell(unfinished, tmp_path, count):
    """Flips spread over the journal: in events, in links, in the ends of lines."""
    setup, folder, accepted = unfinished
    text = (folder / JOURNAL_FILE).read_bytes()
    ends = [8 * i for i, byte in enumerate(text) if byte == ord("\n")]
    bits = [(2 * i + 1) * 8 * len(text) // (2 * count) + i % 8 for i in range(count)]
    for n, bit in enumerate([*ends, *bits]):
        spoiled = bytearray(text)
        spoiled[bit // 8] ^= 1 << bit % 8
        target = copied(folder, tmp_path / f"{n}", bytes(spoiled))
        if damage(target) is None:
            assert bit >= 8 * text.rstrip(b"\n").rfind(b"\n")  # as a torn last record
            continue
        done = mend(setup, target)
        assert done.complete
        assert kept_dwells(target) == accepted
        assert done.kept_as.read_bytes() == spoiled
        found = read_journal(target / JOURNAL_FILE)
        assert not found.torn
        assert found.records[0]["serial"] == setup.unit.serial


def test_a_mended_session_goes_on_and_is_replayed(unfinished, tmp_path):
    setup, folder, accepted = unfinished
    text = bytearray((folder / JOURNAL_FILE).read_bytes())
    at = text.index(b'"accepted"')
    text[at + 3] ^= 1
    target = copied(folder, tmp_path / "001", bytes(text))
    with pytest.raises(RefusedError, match=r"damaged behind its .* `triaxcal rig resume` shows"):
        Recording(setup, target, "test")
    assert mend(setup, target).dwells == 4
    again = Recording(setup, target, "test")
    rig = rig_of(setup, seed=77)
    play(rig, again.feed, again.engine.session)
    again.close()
    final = again.engine.session.accepted
    assert {key: final[key] for key in accepted} == accepted
    played = replay(setup, target / LOG_FILE, target / JOURNAL_FILE)
    assert played.engine.session.accepted == final
    assert played.notes == ()


def test_where_an_operators_word_is_lost_the_journals_own_dwells_count(tmp_path):
    """The log alone would give the dwell before the retake; the journal has the retake."""
    setup = short_setup(tmp_path, temps="[20]")
    rig, folder = rig_of(setup), tmp_path / "001"
    taken = Recording(setup, folder, "test")
    robot, session = Robot(rig), taken.engine.session
    while len([e for e in session.durable if e.dwell]) < 4:
        taken.feed(rig.advance())
        if len(session.accepted) == 2 and not session.redo and len(session.durable) == 4:
            taken.command(Redo("TP1"), rig.seconds * 10**9)
        robot.act(session)
    taken.close()
    accepted = dict(session.accepted)
    text = (folder / JOURNAL_FILE).read_bytes()
    lines = text.splitlines(keepends=True)
    (word,) = (i for i, line in enumerate(lines) if b'"command"' in line)
    lines[word] = lines[word].replace(b"Redo", b"Rebo")
    (folder / JOURNAL_FILE).write_bytes(b"".join(lines))
    played = replay(setup, folder / LOG_FILE, folder / JOURNAL_FILE)
    (note,) = played.notes
    assert note.endswith(
        "the log does not give the same decisions again: a lost record changed them"
    )
    done = mend(setup, folder)
    assert not done.complete
    assert kept_dwells(folder) == accepted
    assert replay(setup, folder / LOG_FILE, folder / JOURNAL_FILE).engine.session.accepted == (
        accepted
    )


def test_a_lost_header_is_believed_only_when_the_log_proves_it(unfinished, tmp_path):
    setup, folder, accepted = unfinished
    text = bytearray((folder / JOURNAL_FILE).read_bytes())
    text[40] ^= 1
    other_plan = short_setup(tmp_path, temps="[20]", rate=100)
    stillness = replace(other_plan.plan.stillness, average_s=30)
    other = Setup(
        setup.folder, setup.unit, replace(other_plan.plan, stillness=stillness), setup.rig
    )
    target = copied(folder, tmp_path / "001", bytes(text))
    with pytest.raises(RefusedError, match=r"its first record is damaged.*`triaxcal rig run`"):
        mend(other, target)
    assert (target / JOURNAL_FILE).read_bytes() == text
    mend(setup, target)
    assert kept_dwells(target) == accepted


def test_resume_asks_before_it_mends(unfinished, tmp_path):
    setup, folder, _ = unfinished
    text = bytearray((folder / JOURNAL_FILE).read_bytes())
    text[text.index(b'"accepted"') + 3] ^= 1
    unit = bench_copy(tmp_path)
    (unit / "sessions").mkdir()
    session = copied(folder, unit / "sessions" / "001", bytes(text))
    common = ("--bus", "virtual", "--plain", "--unit", unit, "--plan", setup.plan.source)
    done = triaxcal("rig", "resume", *common)
    assert done.returncode == 1
    assert "1 are lost; 3 accepted dwells are whole: not gone on with; agree to it with --mend" in (
        done.stderr
    )
    assert (session / JOURNAL_FILE).read_bytes() == text
    again = triaxcal("rig", "resume", *common, "--mend")
    assert again.returncode == 0, again.stderr
    assert "mended: 4 accepted dwells; the log gave again what was lost" in again.stdout
    assert len((unit / "measurements.csv").read_text().splitlines()) == 9


# ---- Records ----


def test_records_that_are_there_are_kept_with_their_date(unfinished, tmp_path):
    setup, folder, _ = unfinished
    session = replay(setup, folder / LOG_FILE, folder / JOURNAL_FILE).engine.session
    state = {"lines": 1, "bytes": 1, "sha256": "1"}
    mine = tmp_path / "measurements.csv"
    mine.write_text("months of work\n")
    os.utime(mine, (1_700_000_000, 1_700_000_000))
    done = write_records(tmp_path, session, setup.rig, state)
    assert [p.name for p in done.kept] == ["measurements.20231114T221320Z.csv"]
    assert done.kept[0].read_text() == "months of work\n"
    assert write_records(tmp_path, session, setup.rig, state).kept == ()
    second = write_records(tmp_path, session, setup.rig, {**state, "sha256": "2"})
    assert [p.suffix for p in second.kept] == [".csv", ".json"]
    assert "log SHA-256 1" in second.kept[0].read_text()
    assert "log SHA-256 2" in mine.read_text()
    assert len(list(tmp_path.iterdir())) == 5


def test_temperatures_that_the_fit_takes_for_one_are_refused_at_once(tmp_path):
    """20 and 22 degC: accepted for hours, then refused by `calib`, in version 0.1.0."""
    unit = short_setup(tmp_path).unit
    for temps, tolerance, good in (
        ("[20, 22]", 1.0, False),
        ("[20, 24]", 1.0, False),
        ("[20, 24.1]", 1.0, True),
        ("[20, 22]", 0.01, False),
        ("[20, 22.1]", 0.01, True),
    ):
        path = tmp_path / "plan.toml"
        path.write_text(
            "format = 1\n[rig]\nrate_hz = 100\nvolts_per_g = [-0.55, -0.55, -0.55]\n"
            f"[steps]\ntemperatures_degc = {temps}\n[thermal]\ntolerance_k = {tolerance}\n"
        )
        if good:
            read_plan(path, unit)
            continue
        with pytest.raises(RefusedError, match=r"temperatures_degc: found 20 and 2. degC; exp"):
            read_plan(path, unit)


# ---- Deliveries ----


@pytest.mark.parametrize("one_step", [True, False])
def test_a_delivery_is_the_old_or_the_new_one_at_every_moment(tmp_path, one_step, monkeypatch):
    """A kill between the renames: here every call that changes names is the last one."""
    if not one_step:
        monkeypatch.setattr("triaxcal.base.publish.exchange", lambda *_: False)
    for calls in range(4):
        target = tmp_path / f"{calls}" / "UNIT"
        publish({"a": b"old"}, target)
        pid = os.fork()
        if not pid:
            _dies_after(calls)
            publish({"a": b"new"}, target)
            os._exit(0)
        os.waitpid(pid, 0)
        if one_step:
            assert (target / "a").read_bytes() in {b"old", b"new"}
            continue
        # Where names cannot change places, the next delivery finds the folder again.
        if not target.exists():
            publish_beside({"a": b"newer"}, target, target.with_name("before"))
            assert (target.with_name("before") / "a").read_bytes() == b"old"
            assert (target / "a").read_bytes() == b"newer"


def _dies_after(calls):
    """Kill this process when it renames once more than so often."""
    left = [calls]

    def counted(real):
        def call(*arguments):
            if not left[0]:
                os.kill(os.getpid(), signal.SIGKILL)
            left[0] -= 1
            return real(*arguments)

        return call

    import triaxcal.base.publish as room

    room.exchange = counted(room.exchange)
    Path.rename = counted(Path.rename)


@pytest.mark.skipif(sys.platform == "win32", reason="nothing there exchanges two names")
def test_two_folders_change_places(tmp_path):
    for name in "ab":
        (tmp_path / name).mkdir()
        (tmp_path / name / "is").write_text(name)
    assert durable.exchange(tmp_path / "a", tmp_path / "b")
    assert (tmp_path / "a" / "is").read_text() == "b"
    assert (tmp_path / "b" / "is").read_text() == "a"
    assert not durable.exchange(tmp_path / "a", tmp_path / "none")


# ---- Clocks ----


@pytest.mark.parametrize(
    "step_s", [-7200, *(pytest.param(s, marks=pytest.mark.long) for s in (-1, 1, 7200))]
)
def test_a_step_of_the_clock_costs_no_dwell_and_makes_none_wrong(tmp_path, step_s):
    """In the middle of the third dwell, and back again in the fifth."""
    setup = short_setup(tmp_path, temps="[20]")
    taken = Recording(setup, tmp_path / "001", "test")
    rig = rig_of(setup)

    def feed(frames):
        shift = step_s * 10**9 if 170 <= rig.seconds < 260 else 0
        return taken.feed(replace(frames, t_ns=frames.t_ns + shift))

    play(rig, feed, taken.engine.session)
    taken.close()
    played = replay(setup, tmp_path / "001" / LOG_FILE, tmp_path / "001" / JOURNAL_FILE)
    assert played.engine.session.accepted == taken.engine.session.accepted
    undisturbed = Recording(setup, tmp_path / "002", "test")
    play(rig_of(setup), undisturbed.feed, undisturbed.engine.session)
    undisturbed.close()
    for key, dwell in taken.engine.session.accepted.items():
        right = undisturbed.engine.session.accepted[key]
        off = [
            abs(a - b) / u
            for a, b, u in zip(dwell.mean_code, right.mean_code, right.u_code, strict=True)
        ]
        # Two dwells of the same truth, ten batch means each: Student's t, once in 10^4.
        assert max(off) < 8.2 * 2**0.5


def test_a_journal_is_opened_for_appending(tmp_path):
    """What another program wrote meanwhile is not written over."""
    journal = Journal(tmp_path / JOURNAL_FILE)
    journal.append({"kind": "a"})
    with (tmp_path / JOURNAL_FILE).open("ab") as other:
        other.write(b"somebody else's\n")
    journal.append({"kind": "b"})
    journal.close()
    text = (tmp_path / JOURNAL_FILE).read_bytes()
    assert text.count(b"\n") == 3
    assert b"somebody else's\n" in text
    assert [r["kind"] for r in read_journal(tmp_path / JOURNAL_FILE).records] == ["a"]
