"""Many units in one session: told apart, measured together, each with records of its own."""

from __future__ import annotations

import hashlib
import io
import json

import numpy as np
import pytest
from click.testing import CliRunner
from many_cases import Run, bench_of, plan_of, refuse_false_records, setup_of
from rich.console import Console
from test_cli_rig import triaxcal

from triaxcal.base.errors import RefusedError, UsageError
from triaxcal.cli.main import main
from triaxcal.cli.rig_live import Operator
from triaxcal.rig.bus.frames import ERR_FLAG, Frames, alike, concatenate
from triaxcal.rig.many.replay import replay_bus
from triaxcal.rig.many.screen import HELP, group_line, many_screen
from triaxcal.rig.many.setup import many_of_plan, one_of_plan
from triaxcal.rig.records import rawlog
from triaxcal.rig.records.journal import read_journal
from triaxcal.rig.records.recording import JOURNAL_FILE
from triaxcal.rig.records.replay import replay
from triaxcal.rig.records.store import write_records
from triaxcal.rig.samples.split import Splitter
from triaxcal.rig.screen.screen import help_page
from triaxcal.rig.session.events import Redo
from triaxcal.rig.session.phases import Turning

J1939_UNIT = """
format = 1
serial = "SN-1"
[adc]
bits = 17
code_min = 0
code_max = 65535
full_scale_v = 65.536
[temperature_sensor]
degc_per_code = 0.03125
degc_at_zero = -273
[site]
local_gravity_m_per_s2 = 9.81
[thermal]
t0_degc = 20
range_degc = [-40, 70]
"""
"""Codes as the shipped description of that sensor has them."""
ALL = [(0, f"TP{k}") for k in range(1, 7)]


def frame_ids(setup):
    return sorted(use.layout.can_id for use in setup.rig.messages.values())


# ---- the plan ----


def test_each_unit_has_ids_of_its_own(tmp_path):
    """tilter.dbc has 0x100 to 0x102 and 0x110; units are 0x10 apart, 16 of them on a bus."""
    path = plan_of(tmp_path, 1)
    (first,) = many_of_plan(path).places
    whole = frame_ids(first.setup)
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("id_offset = 0", "id_offset = 0x400"), encoding="utf-8")
    moved = one_of_plan(path, "AT-1")
    assert frame_ids(moved) == [can_id + 0x400 for can_id in whole]
    assert moved.plan.take_out_of_order


def test_units_of_j1939_differ_in_their_source_address(tmp_path):
    path = plan_of(tmp_path, 1)
    text = path.read_text(encoding="utf-8").replace('layout = "classic"', "").replace(
        "id_offset = 0", 'rig = "j1939-inclinometer"\nsource_address = 0x42'
    )  # fmt: skip
    path.write_text(text.replace("volts_per_g = [-0.55, -0.55, -0.55]", ""), encoding="utf-8")
    (tmp_path / "units" / "AT-1" / "unit.toml").write_text(J1939_UNIT, encoding="utf-8")
    ids = frame_ids(one_of_plan(path, "AT-1"))
    assert len(ids) == 2
    assert all(can_id & 0xFF == 0x42 for can_id in ids)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("id_offset = 16", "id_offset = 0", "AT-1 and AT-2 have the same IDs on can0: "),
        ("id_offset = 16", "id_offset = 1", "AT-1 and AT-2 have the same IDs on can0: "),
        ("id_offset = 16", "id_offset = 0x800", "[unit.AT-2] id_offset: found 2048: the ID of "),
        ("id_offset = 16", "source_address = 9", "[unit.AT-2] source_address: given, and all IDs"),
        ('folder = "units/AT-2"', 'folder = "units/AT-1"', "AT-1 and AT-2 have the same folder"),
        ('folder = "units/AT-2"', 'folder = "units/AT-9"', 'no such unit (did you mean "AT-'),
        ('folder = "units/AT-2"', 'serial = "X"\nfolder = "units/AT-2"', "serial: found X"),
        ("id_offset = 16", "id_ofset = 16", "unknown: [unit.AT-2] id_ofset (did you mean"),
    ],
)
def test_a_plan_that_cannot_be_is_refused(tmp_path, old, new, said):
    path = plan_of(tmp_path, 2)
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(RefusedError) as refused:
        many_of_plan(path)
    assert said in str(refused.value)


def test_units_share_ids_on_different_buses_but_never_a_serial_number(tmp_path):
    path = plan_of(tmp_path, 2, AT_2="can1")
    text = path.read_text(encoding="utf-8").replace("id_offset = 16", "id_offset = 0")
    path.write_text(text, encoding="utf-8")
    assert many_of_plan(path).buses == ("can0", "can1")
    unit = tmp_path / "units" / "AT-2" / "unit.toml"
    unit.write_text(unit.read_text(encoding="utf-8").replace("SN-0002", "SN-0001"))
    with pytest.raises(RefusedError, match=r'"SN-0001" is also the serial of .*AT-2'):
        many_of_plan(path)


def test_a_unit_needs_a_bus(tmp_path):
    path = plan_of(tmp_path, 2)
    text = path.read_text(encoding="utf-8").replace('bus = "can0"\n', "", 1)
    path.write_text(text, encoding="utf-8")
    with pytest.raises(RefusedError, match=r"\[unit.AT-1\] bus: missing; expected a bus here"):
        many_of_plan(path)
    assert [p.bus for p in many_of_plan(path, "can7").places] == ["can7", "can0"]


def test_no_more_than_32_units(tmp_path):
    path = plan_of(tmp_path, 2)
    more = "".join(f"[unit.B{i}]\n" for i in range(31))
    path.write_text(path.read_text(encoding="utf-8") + more, encoding="utf-8")
    with pytest.raises(RefusedError, match="lists 33 units; expected at most 32"):
        many_of_plan(path)


@pytest.mark.parametrize(
    ("order", "said"),
    [("AT-9/slip@3", "a unit of the plan"), ("AT-1/halt@3", "all units share chamber and table")],
)
def test_faults_of_one_unit(tmp_path, order, said):
    with pytest.raises(UsageError, match=said):
        bench_of(setup_of(tmp_path, 1), order)


# ---- the frames ----


def test_frames_go_to_the_unit_that_sent_them(tmp_path):
    setup = setup_of(tmp_path, 3)
    splitter = Splitter([place.setup.rig for place in setup.places])
    first = frame_ids(setup.places[0].setup)[0]

    def sent(*ids: int) -> Frames:
        one = np.zeros((1, 8), np.uint8)
        return concatenate([alike(np.array([k]), i, 8, False, one) for k, i in enumerate(ids)])

    parts = splitter.split(sent(first + 32, first, 0x7FF, first + 32, first + 16))
    assert [part.t_ns.tolist() for part in parts] == [[1], [4], [0, 3]]
    parts = splitter.split(sent(first + 32, ERR_FLAG | 8, first))
    assert [part.t_ns.tolist() for part in parts] == [[1, 2], [1], [0, 1]]


# ---- sessions ----


def test_another_unit_is_refused_at_the_start(tmp_path):
    setup = setup_of(tmp_path, 2)
    run = Run(setup, bench_of(setup, "AT-2/serial@0"), tmp_path / "001")
    with pytest.raises(RefusedError, match=r'expected "SN-0002" \(0x[0-9A-F]{8}\) of AT-2'):
        run.go()


def test_two_units_with_exchanged_plugs_are_refused(tmp_path):
    setup = setup_of(tmp_path, 2)
    bench = bench_of(setup)
    path = tmp_path / "many.toml"
    text = path.read_text(encoding="utf-8")
    text = text.replace("id_offset = 0\n", "id_offset = X\n").replace("= 16", "= 0")
    path.write_text(text.replace("= X", "= 16"), encoding="utf-8")
    run = Run(many_of_plan(path), bench, tmp_path / "001")
    with pytest.raises(RefusedError, match=r"number 'SN-0002' of AT-2 .* expected .SN-0001."):
        run.go()


def test_a_unit_that_is_silent_from_the_start_is_refused(tmp_path):
    setup = setup_of(tmp_path, 2, tables="[unattended]\nsilence_max_s = 5\n")
    run = Run(setup, bench_of(setup, "AT-2/linkdown@0:1:99"), tmp_path / "001")
    with pytest.raises(RefusedError, match="can0, AT-2: no readings for 5 s"):
        run.go()


@pytest.mark.long
def test_one_dies_one_slips_the_others_go_on(tmp_path):
    setup = setup_of(tmp_path, 3, "[20, 25]")
    orders = ("AT-2/linkdown@150:1:99999", "AT-3/slip@84:150", "halt@120:1:20", "deaf@40:1:15")
    run = Run(setup, bench_of(setup, *orders), tmp_path / "001", alone=True).go()
    asides = {m.name: m.aside for m in run.group.members}
    assert asides == {"AT-1": "", "AT-2": "no readings for 60 s", "AT-3": ""}
    for name in ("AT-1", "AT-3"):
        assert sorted(run.accepted(name)) == sorted(ALL + [(1, p) for _, p in ALL])
    slips = [e.text for m, e in run.told if m.name == "AT-3" and e.kind == "refused"]
    assert any(text.startswith("TP1: slip of 14") for text in slips)
    # The slipped unit leaves TP1 without the others' waiting for a second dwell in it.
    order = [p for s, p in run.accepted("AT-3") if s == 0]
    assert order.index("TP1") > order.index("TP2")
    records = read_journal(tmp_path / "001" / JOURNAL_FILE).records
    assert [r["unit"] for r in records if r["kind"] == "aside"] == ["AT-2"]
    for place in setup.places[::2]:
        member = next(m for m in run.group.members if m.place is place)
        folder = tmp_path / place.name
        folder.mkdir()
        write_records(folder, member.session, place.setup.rig, {"sha256": ""})
        assert refuse_false_records(place, folder) == 12


@pytest.mark.long
def test_a_session_is_gone_on_with_and_made_again_from_its_logs(tmp_path):
    setup = setup_of(tmp_path, 2)
    bench, folder = bench_of(setup, "AT-1/lose@100:30"), tmp_path / "001"
    first = Run(setup, bench, folder).go(until=lambda run: len(run.accepted("AT-2")) == 2)
    again = Run(setup, bench, folder)
    assert again.taken.resumed
    again.go()
    assert [len(first.accepted(n)) + len(again.accepted(n)) for n in ("AT-1", "AT-2")] == [6, 6]
    played, _ = replay_bus(setup, folder, "can0", ["AT-1", "AT-2"])
    for member in again.group.members:
        assert played[member.name].accepted == member.session.accepted
    # Samples have two frames, each tenth one a temperature besides, the first an identity: 30
    # frames from a full second on are 4 + 9 * 2 + 3 + 2 * 2 + 1, of 14 samples.
    assert played["AT-1"].lost == 14
    # One unit's own session out of the same log, as `rig replay --unit` does.
    alone = replay(one_of_plan(tmp_path / "many.toml", "AT-2"), folder / "frames-1.log")
    assert alone.engine.session.accepted == again.group.members[1].session.accepted


@pytest.mark.long
def test_a_session_killed_before_its_records_is_delivered_by_resume(tmp_path, monkeypatch):
    """However long its log is: the hash of what came before the restart is not yet known then."""
    setup = setup_of(tmp_path, 2)
    Run(setup, bench_of(setup), setup.sessions / "001").go()
    monkeypatch.setattr(rawlog, "_HASH_BYTES", 1000)
    done = CliRunner().invoke(
        main, ["rig", "resume", "--plan", setup.source, "--bus", "virtual", "--plain"]
    )
    assert done.exit_code == 0, done.output
    log = setup.sessions / "001" / "frames-1.log"
    for place in setup.places:
        sidecar = json.loads((place.setup.folder / "measurements.json").read_text())
        assert sidecar["log"]["sha256"] == hashlib.sha256(log.read_bytes()).hexdigest()
        assert refuse_false_records(place, place.setup.folder) == 6


@pytest.mark.long
def test_a_unit_set_aside_stays_so_and_another_plan_is_refused(tmp_path):
    setup = setup_of(tmp_path, 2, tables="[unattended]\nsilence_max_s = 5\n")
    bench, folder = bench_of(setup, "AT-2/linkdown@80:1:20"), tmp_path / "001"
    Run(setup, bench, folder).go(until=lambda run: run.group.members[1].aside)
    again = Run(setup, bench, folder)
    assert again.group.members[1].aside == "no readings for 5 s"
    assert [m.name for m in again.group.active] == ["AT-1"]
    again.taken.close()
    other = setup_of(tmp_path / "other", 3)
    with pytest.raises(RefusedError, match="of the units AT-1, AT-2; expected AT-1, AT-2, AT-3"):
        Run(other, bench_of(other), folder)


@pytest.mark.long
def test_a_bus_that_is_silent_stops_the_run_and_sets_nobody_aside(tmp_path):
    tables = "[unattended]\nsilence_max_s = 5\n"
    path = plan_of(tmp_path, 4, "[20]", tables, AT_3="can1", AT_4="can1")
    setup = many_of_plan(path)
    orders = [f"AT-{k}/linkdown@90:1:9999" for k in (3, 4)]
    run = Run(setup, bench_of(setup, *orders), tmp_path / "001", alone=True)
    with pytest.raises(RefusedError, match="unattended run: no readings from can1 for 5 s"):
        run.go()
    assert not any(m.aside for m in run.group.members)


@pytest.mark.long
def test_a_unit_that_never_rests_is_set_aside_after_its_attempts(tmp_path):
    setup = setup_of(tmp_path, 3, tables="[unattended]\nattempts = 2\n")
    orders = [f"AT-2/nudge@{s}:40:0.3" for s in range(62, 600, 9)]
    run = Run(setup, bench_of(setup, *orders), tmp_path / "001").go()
    assert run.accepted("AT-1") == run.accepted("AT-3") == ALL
    assert run.accepted("AT-2") == []
    aside = run.group.members[1].aside
    assert aside.startswith("at 20 degC 2 times, the last time: TP2: shaken: variance on "), aside


@pytest.mark.long
def test_what_hits_all_alike_stops_an_unattended_run(tmp_path):
    """The chamber leaves its temperature again and again: no unit is to blame."""
    setup = setup_of(tmp_path, 3, tables="[unattended]\nattempts = 2\n")
    orders = [f"runaway@{s}:4:30" for s in (90, 240)]
    run = Run(setup, bench_of(setup, *orders), tmp_path / "001", alone=True)
    with pytest.raises(RefusedError, match=r"run: [23] units at 20 degC 2 times, the last"):
        run.go()
    assert not any(m.aside for m in run.group.members)


def test_the_screen_asks_a_person_to_turn_and_nobody_where_a_table_does(tmp_path):
    setup = setup_of(tmp_path, 2)
    for alone, line in ((False, "TURN TO TP1 (+Z up)"), (True, "THE TABLE TURNS TO TP1 (+Z up)")):
        bench = bench_of(setup)
        bench.turn_to("TP3")
        run = Run(setup, bench, tmp_path / f"{alone}", alone=alone)
        run.hands = None
        for member in run.group.members:
            member.engine.session.phase = Turning()
        assert group_line(run.group) == line
        text = drawn(many_screen(run.group, "001", "12:00", ""))
        assert text.splitlines()[0].startswith(" 2 units   session 001   ends 12:00   0/12")
        assert [name in text for name in ("AT-1", "AT-2", "NO READINGS")] == [True] * 3
        run.taken.close()
        run.sources.close()


def drawn(view) -> str:
    console = Console(width=80, height=24, file=io.StringIO(), record=True)
    console.print(view)
    return console.export_text()


@pytest.mark.long
def test_the_command_line_tells_what_became_of_each_unit(tmp_path):
    path = plan_of(tmp_path, 2, "[20]", "[unattended]\nsilence_max_s = 5\n")
    options = ("--plan", path, "--bus", "virtual", "--plain", "--fault", "AT-2/linkdown@90:1:9999")
    done = triaxcal("rig", "run", *options, "--unattended")
    assert done.returncode == 1
    lines = done.stdout.splitlines()
    assert any(line.endswith("AT-2 set aside: no readings for 5 s") for line in lines)
    assert any(line.endswith("all: DONE - 1 units measured, 1 set aside") for line in lines)
    assert lines[-1] == f"next: triaxcal batch {tmp_path}/units/AT-1"
    assert done.stderr.splitlines()[-1].startswith(
        f"triaxcal: {tmp_path}/many-sessions/001: 1 of 2 units set aside: AT-2; measure each"
    )
    assert [(tmp_path / "units" / n / "measurements.csv").exists() for n in ("AT-1", "AT-2")] == [
        True, False,
    ]  # fmt: skip
    listed = triaxcal("rig", "status", "--plan", path).stdout.splitlines()
    assert listed[0].startswith(f"{tmp_path}/many-sessions/001: ")
    assert "  AT-1: 6 accepted dwells" in listed
    assert any(
        line.startswith("  AT-2: ") and line.endswith("; set aside: no readings for 5 s")
        for line in listed
    )
    assert sum(line.startswith("    TP") for line in listed) >= 6
    alone = triaxcal("rig", "run", *options[:4], "--plain", "--unit", "AT-2")
    assert alone.returncode == 0, alone.stderr
    assert (tmp_path / "units" / "AT-2" / "measurements.csv").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "Missing option '--unit', or a '--plan' that lists units."),
        (("--unit", "AT-SIM-BENCH"), "Missing option '--bus'."),
    ],
)
def test_a_session_needs_a_unit_and_a_bus(arguments, said):
    done = CliRunner().invoke(main, ["rig", "run", *arguments])
    assert done.exit_code == 2
    assert said in done.output


def test_every_unit_can_be_scrolled_to_and_the_keys_are_explained(tmp_path):
    setup = setup_of(tmp_path, 32)
    run = Run(setup, bench_of(setup), tmp_path / "001")
    names = {place.name for place in setup.places}

    def shown(scrolled, page=None):
        text = drawn(many_screen(run.group, "001", "12:00", "", page=page, scrolled=scrolled))
        assert len(text.splitlines()) <= 24
        return text, {word for word in text.split() if word in names}

    pages = [shown(k)[1] for k in range(1, 5)]
    assert [sorted(page) for page in pages[:2]] == [
        sorted(f"AT-{k}" for k in range(1 + 11 * n, 12 + 11 * n)) for n in range(2)
    ]
    assert set.union(*pages[:3]) == names
    assert shown(4)[1] == shown(0)[1]  # behind the last page comes the first screen
    assert shown(-1)[1] == pages[2]
    assert "and 21 more" in shown(1)[0]
    text, units = shown(0, help_page(HELP))
    assert not units
    for key, _ in HELP:
        assert key in text
    run.taken.close()
    run.sources.close()


def test_keys_of_many_units():
    class Typed:
        def pressed(self):
            return "nnb?c3"

    operator = Operator(Typed())
    assert operator.words() == [Redo("CP3")]
    assert (operator.scrolled, operator.page) == (1, "help")
