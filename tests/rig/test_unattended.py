"""Unattended runs in simulated time: what they outlive, what stops them, and what they leave."""

from __future__ import annotations

import threading
from itertools import pairwise

import pytest
from instrument_cases import SIMULATED, setup_with, walk
from rig_cases import rig_of, short_setup

from triaxcal.base.errors import RefusedError
from triaxcal.rig.hands.link import Link
from triaxcal.rig.hands.orientation import UP
from triaxcal.rig.live.attendant import Attendant, attendant
from triaxcal.rig.live.runner import Robot
from triaxcal.rig.live.simhands import SimulatedChamber, SimulatedTable, simulated_attendant
from triaxcal.rig.screen.view import view
from triaxcal.rig.session.forecast import duration, settle_s

LEARNED = 61
"""Seconds after which the noise of the short plan is known."""


def accepted(events):
    return [(e.step, e.dwell.position) for e in events if e.kind == "accepted"]


ALL = [(step, f"TP{k}") for step in range(2) for k in range(1, 7)]


def run(setup, *orders, blind=False, **settings):
    rig = rig_of(setup, *orders, **settings)
    return rig, simulated_attendant(setup.plan, rig, blind)


def test_a_plan_is_walked(tmp_path):
    setup = short_setup(tmp_path)
    rig, hands = run(setup)
    _, events, said = walk(setup, rig, hands)
    assert accepted(events) == ALL
    assert [e.text for e in events if e.kind == "trouble"] == []
    moves = [text for _, text in said if text.startswith("chamber")]
    assert moves == ["chamber: from 20.0 to 20 degC", "chamber: from 20.0 to 25 degC"]
    assert hands.make_safe() == ["chamber: set to the safe 23 degC", "positioner: left as it is"]
    assert rig.target_degc == 23.0


@pytest.mark.long
def test_the_time_left_is_corrected_by_what_was_seen(tmp_path):
    """From the first dwell at the second temperature on, nothing is left that was not seen before:
    within a tenth, and the block that a turn or an equilibrium waits for.
    """
    setup = short_setup(tmp_path, temps="[15, 20, 25]")
    rig, hands = run(setup)
    _, events, said = walk(setup, rig, hands)
    end = rig.seconds
    left = [(at, text) for at, text in said if text.startswith("left: about ")]
    assert len(left) >= len(accepted(events)) - 1
    for at, text in left[9:]:
        minutes = int(text.removeprefix("left: about ").removesuffix(" min"))
        assert abs(60 * minutes - (end - at)) <= 0.1 * (end - at) + 60 + 5


@pytest.mark.parametrize(
    ("slew", "tau", "change", "seconds"),
    [
        # At rest: the window alone, 30 s.
        (0.0, 100.0, 0.0, 30.0),
        # A jump of 10 K with 100 s: lag 10 (e^0.3 - 1) / 30 = 0.11662 K/s against 0.005 K/s:
        # 100 ln 23.324 = 314.9 s; near the target, 100 ln 10 = 230 s, is earlier.
        (0.0, 100.0, 10.0, 314.96),
        # 6 K/min for 100 s: lag 0.1 * 100 (1 - e^-1) = 6.3212 K; 100 + 100 ln 14.744 = 369.08 s.
        (6.0, 100.0, 10.0, 369.08),
    ],
)
def test_the_time_to_an_equilibrium(tmp_path, slew, tau, change, seconds):
    tables = f"[chamber]\nslew_k_per_min = {slew}\ntau_s = {tau}\n"
    plan = setup_with(tmp_path, tables).plan
    assert settle_s(plan, 20.0, 20.0 - change) == pytest.approx(seconds, abs=0.1)


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0, "0 min"), (61, "2 min"), (3600, "1 h 00 min"), (20_000, "5 h 34 min")],
)
def test_durations(seconds, words):
    assert duration(seconds) == words


@pytest.mark.long
@pytest.mark.parametrize(
    ("order", "said"),
    [
        ("deaf@40:1:15", None),
        (
            "astray@90:1:20",
            "positioner: told to go to TP2 (-Y up), not there after 20 s: it answers 3",
        ),
        ("halt@90:1:20", "positioner: told to go to TP2 (-Y up), not there after 20 s: it answers"),
        ("slip@84:150", None),
        ("linkdown@100:1:20", None),
    ],
)
def test_what_passes_is_outlived(tmp_path, order, said):
    setup = setup_with(tmp_path, "[positioner]\nturn_max_s = 20\n", temps="[20]")
    rig, hands = run(setup, order)
    _, events, notes = walk(setup, rig, hands)
    assert sorted(accepted(events)) == ALL[:6]
    texts = [text for _, text in notes]
    assert said is None or any(text.startswith(said) for text in texts), texts


def test_a_table_that_cannot_be_asked_is_seen_by_the_readings(tmp_path):
    setup = short_setup(tmp_path, temps="[20]")
    rig, hands = run(setup, "astray@90:1:20", blind=True)
    _, events, notes = walk(setup, rig, hands)
    assert sorted(accepted(events)) == ALL[:6]
    wrong = "positioner: told to go to TP2 (-Y up), the readings show TP3 (-Z up); turned away"
    assert any(text.startswith(wrong) for _, text in notes)


def test_a_table_that_says_it_is_where_it_is_not(tmp_path):
    """Its encoder slipped on the shaft: it answers what it was told, the readings do not agree."""
    setup = setup_with(tmp_path, "[positioner]\nturn_max_s = 20\n", temps="[20]")
    rig, hands = run(setup, "astray@85:1:9999")
    position = setup.plan.equipment.positioner
    hands._table._link._open = lambda: Liar(rig, position)
    with pytest.raises(
        RefusedError, match=r"positioner: told to go to TP\d .*, the readings show TP"
    ):
        walk(setup, rig, hands, limit_s=1000)


class Liar(SimulatedTable):
    def write(self, order):
        super().write(order)
        self.told = order.numbers

    def read(self):
        return self.told


@pytest.mark.long
def test_a_chamber_that_overshoots_is_waited_for(tmp_path):
    """15 % of 30 K: 4.5 K, within overshoot_max_k; no dwell is taken before it has settled."""
    setup = setup_with(tmp_path, "", temps="[20, 50]")
    rig, hands = run(setup, overshoot=0.15, chamber_tau_s=20.0)
    highest = []
    _, events, _ = walk(setup, rig, hands, each=lambda: highest.append(rig.chamber_degc))
    assert 53.0 < max(highest) < 55.0
    assert accepted(events) == ALL
    temps = [e.dwell.temp_degc for e in events if e.kind == "accepted" and e.step == 1]
    assert max(temps) - min(temps) <= setup.plan.thermal.span_max_k
    assert all(abs(t - 50.0) <= setup.plan.thermal.tolerance_k for t in temps)


LIMITS = """
[chamber]
settle_max_s = 300
[positioner]
turn_max_s = 20
home = "TP1"
[unattended]
still_max_s = 100
silence_max_s = 30
"""


CYCLES = {"cycle_k": 2.0, "cycle_s": 60.0}
SLIPS = [f"slip@{at}:150" for at in range(84, 900, 23)]
STOPS = [
    (["deaf@0:1:9999"], {}, r"(chamber|positioner): .*: no answer within 5 s \(tried 3 t"),
    (["kelvin@0:1:9999"], {}, r"chamber: answers 293.15, which is K: the unit is at 2\d.\d"),
    (["runaway@200:40:9999"], {}, r"chamber: (it|the unit) is at [23]\d.\d degC; expected 15"),
    (["halt@85:1:9999"], {}, r"positioner: .*, not there after 20 s: it answers 4\d \(tri"),
    (["astray@85:1:9999"], {}, r"positioner: .*, not there after 20 s: it answers \d \(tried"),
    (["linkdown@200:1:9999"], {}, r"unattended run: no readings for 30 s; what was accepted"),
]  # fmt: skip
MORE_STOPS = [
    (["deaf@200:1:9999"], {}, r"(chamber|positioner): .*no answer within 5 s \(tried 3 tim"),
    (["kelvin@200:1:9999"], {}, r"chamber: it is at 29\d.\d degC; expected 15.0 to 25.\d d"),
    ([], CYCLES, r"no equilibrium at 20 degC within 300 s: \d+.\d\d degC, [-+]\d.\d+ K"),
    (["status@10:2:9999"], {}, r"not learned within 160 s: the rig reports status 0x02"),
    (["status@85:2:9999"], {}, r"run: TP\d was not at rest within 100 s: the rig reports sta"),
    (SLIPS, {}, r"unattended run: at 20 degC 3 times, the last time: TP\d: [a-z]+ of"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("orders", "settings", "said"),
    [*STOPS, *(pytest.param(*case, marks=pytest.mark.long) for case in MORE_STOPS)],
)
def test_what_stays_wrong_stops_the_run_with_its_reason(tmp_path, orders, settings, said):
    setup = setup_with(tmp_path, LIMITS + "attempts = 3\n", temps="[20, 25]")
    rig, hands = run(setup, *orders, **settings)
    with pytest.raises(RefusedError, match=said) as refusal:
        walk(setup, rig, hands, limit_s=2500)
    assert "\n" not in str(refusal.value)
    chamber, table = hands.make_safe()
    if rig.active("deaf"):
        assert chamber.startswith("chamber: NOT set to the safe 23 degC, do it by hand: simulated")
        assert table.startswith("positioner: NOT sent home to TP1, do it by hand: simulated")
    else:
        assert (chamber, table) == (
            "chamber: set to the safe 23 degC", "positioner: sent home to TP1",
        )  # fmt: skip
        assert rig.target_degc == 23.0


def test_what_a_person_must_do_is_refused_at_the_start(tmp_path):
    plan = short_setup(tmp_path).plan
    with pytest.raises(
        RefusedError, match=r'\[positioner\] driver: found "operator"; expected a dr'
    ):
        attendant(plan, lambda: 0.0)
    tables = '[positioner]\ndriver = "command"\ncommand = ["turn", "{position}"]\n'
    with pytest.raises(RefusedError, match=r'\[chamber\] driver: found "operator"'):
        attendant(setup_with(tmp_path, tables).plan, lambda: 0.0)
    attendant(setup_with(tmp_path, tables, temps="[20]").plan, lambda: 0.0)


@pytest.mark.long
def test_the_screen_asks_nobody_to_turn(tmp_path):
    setup = short_setup(tmp_path)
    rig, hands = run(setup)
    shown = {}

    class Seen:
        def act(self, session, events):
            hands.act(session, events)
            found = hands.shown(session, view(session))
            shown.setdefault(found.phase, []).append(found)

        notes = staticmethod(hands.notes)

    walk(setup, rig, Seen())
    assert all(v.order.startswith("HANDS OFF") for p in shown if p != "done" for v in shown[p])
    assert shown["turn"][0].headline == "UNATTENDED - turning to TP2 (-Y up), do not touch"
    waiting = shown["temperature"][-1]
    assert waiting.headline == "UNATTENDED - waiting for 25 degC, do not touch"
    assert shown["temperature"][1].last_event == "chamber: from 20.0 to 25 degC"
    asks = ("TURN", "WAIT")
    assert [v.headline for p in shown for v in shown[p] if v.headline.startswith(asks)] == []
    assert 0.0 < waiting.left_s < shown["reference"][0].left_s
    assert shown["done"][0].order == "DONE"


@pytest.mark.long
def test_instruments_are_asked_beside_the_loop(tmp_path):
    """As on a real rig: each question in a thread of its own, while the readings come."""
    setup = setup_with(tmp_path, "[positioner]\nturn_max_s = 3000\n", temps="[20]")
    rig = rig_of(setup)
    chamber, table = SimulatedChamber(rig), SimulatedTable(rig, setup.plan.equipment.positioner)
    threads = set()

    def noted(read):
        threads.add(threading.get_ident())
        return read()

    chamber.read, read = (lambda: noted(read)), chamber.read
    hands = Attendant(
        setup.plan, (lambda: chamber, True), (lambda: table, True), lambda: float(rig.seconds)
    )
    _, events, _ = walk(setup, rig, hands)
    assert sorted(accepted(events)) == ALL[:6]
    assert threading.get_ident() not in threads
    assert hands.make_safe() == ["chamber: set to the safe 23 degC", "positioner: left as it is"]
    assert rig.target_degc == 23.0


@pytest.mark.long
def test_beside_a_person_the_chamber_alone_is_set(tmp_path):
    """A person turns the unit; the bench sets the chamber and does not stop by its own limits."""
    setup = setup_with(tmp_path, LIMITS.replace("= 300", "= 10") + "attempts = 1\n")
    rig = rig_of(setup, "slip@84:150", "linkdown@130:1:40")
    chamber = SimulatedChamber(rig)
    hands = Attendant(
        setup.plan, (lambda: chamber, True), None, lambda: float(rig.seconds), at_once=True,
        alone=False,
    )  # fmt: skip
    person = Robot(rig)

    class Both:
        def act(self, session, events):
            hands.act(session, events)
            if not session.done:
                person.act(session, events)
                rig.target_degc = told[-1] if told else 20.0

        notes = staticmethod(hands.notes)

    told = []
    chamber.write = lambda order: told.append(order.words["degc"])
    _, events, _ = walk(setup, rig, Both())
    assert sorted(accepted(events)) == ALL
    assert told == [20.0, 25.0]
    assert hands.make_safe() == ["chamber: set to the safe 23 degC"]


@pytest.mark.long
def test_instruments_by_visa_walk_the_plan(tmp_path):
    """The chamber and the table of pyvisa-sim are told; the rig follows what they were told."""
    pyvisa = pytest.importorskip("pyvisa")
    pytest.importorskip("pyvisa_sim")
    angles = {p: [30.0 * i] for i, p in enumerate(UP)}
    said = ", ".join(f"{p} = {a}" for p, a in angles.items())
    tables = f"""
[chamber]
driver = "scpi"
scpi_library = {SIMULATED!r}
scpi_resource = "GPIB::8::INSTR"
scpi_set = "KEL {{kelvin:.2f}}"
scpi_answers = true
scpi_read = "KEL?"
unit = "K"
slew_k_per_min = 3
[positioner]
driver = "scpi"
scpi_library = {SIMULATED!r}
scpi_resource = "GPIB::9::INSTR"
scpi_set = "MOVE {{angle1:.3f}}"
scpi_read = "ROLL?"
angles = {{{said}}}
"""
    setup = setup_with(tmp_path, tables)
    rig = rig_of(setup)
    manager = pyvisa.ResourceManager(SIMULATED)
    ends = {"read_termination": "\n", "write_termination": "\n"}
    chamber = manager.open_resource("GPIB::8::INSTR", **ends)
    table = manager.open_resource("GPIB::9::INSTR", **ends)
    chamber.query("KEL 293.15")
    table.write("MOVE 0.000")
    told = []

    def follow():
        kelvin = float(chamber.query("KEL?").removeprefix("T1=").removesuffix(" K"))
        rig.target_degc = kelvin - 273.15
        told.append(kelvin)
        rig.turn_to(f"TP{round(float(table.query('ROLL?')) / 30.0) + 1}")

    hands = attendant(setup.plan, lambda: float(rig.seconds), at_once=True)
    _, events, _ = walk(setup, rig, hands, each=follow)
    assert accepted(events) == ALL
    steps = [b - a for a, b in pairwise(told) if b != a]
    assert 0.0 < max(steps) <= 0.6  # 3 K/min, each 10 s, in tenths of a kelvin
    assert told[-1] == 298.15
    assert hands.make_safe()[0] == "chamber: set to the safe 23 degC"
    assert chamber.query("KEL?") == "T1=296.15 K"


class Slow:
    """Answers when the test lets it."""

    def __init__(self, gate, value):
        self.gate, self.value, self.closed = gate, value, False

    def write(self, _):
        self.gate.wait(60)

    def read(self):
        self.gate.wait(60)
        return (self.value,)

    def close(self):
        self.closed = True


def until_it_answers(link):
    while (answer := link.collect(1.0)) is None:
        pass
    return answer


def test_a_late_answer_holds_nothing_up_and_is_not_taken_for_the_next():
    gate, there = threading.Event(), []

    def opened():
        there.append(Slow(gate, float(len(there))))
        return there[-1]

    link = Link("meter", opened, timeout_s=0.05, again_s=0.0, attempts=1)
    link.ask(lambda instrument: instrument.read(), 0.0)
    assert link.collect(0.0) is None  # it does not wait for the answer
    with pytest.raises(RefusedError, match=r"meter: no answer within 0.05 s \(tried once\)"):
        until_it_answers(link)
    gate.set()  # now the late answer comes, to nobody
    link.ask(lambda instrument: instrument.read(), 1.0)
    assert tuple(until_it_answers(link)) == (1.0,)
    assert link.last_order(lambda instrument: instrument.write(None)) == ""


def test_the_last_order_opens_a_connection_of_its_own():
    """One that hangs is left alone; an instrument that hangs for good is reported."""
    gate = threading.Event()
    free = threading.Event()
    free.set()
    made = []

    def opened():
        made.append(Slow(free if made else gate, 0.0))
        return made[-1]

    link = Link("chamber", opened, timeout_s=0.05, again_s=0.0, attempts=2)
    link.ask(lambda instrument: instrument.read(), 0.0)
    assert link.last_order(lambda instrument: instrument.write(None)) == ""
    assert len(made) == 2
    hung = Link("chamber", lambda: Slow(gate, 0.0), timeout_s=0.05, again_s=0.0, attempts=2)
    assert hung.last_order(lambda i: i.write(None)) == "no answer within 0.05 s"
    gate.set()


def test_a_question_that_was_given_up_gives_no_order_later():
    """As one that hangs while its connection is opened, and ends after the safe order."""
    begin, ordered, closed = threading.Event(), [], threading.Event()

    class Late:
        def close(self):
            closed.set()

    def opened():
        begin.wait(60)
        return Late()

    link = Link("chamber", opened, timeout_s=0.01, again_s=0.0, attempts=1)
    link.ask(ordered.append, 0.0)
    with pytest.raises(RefusedError, match="no answer within"):
        until_it_answers(link)
    begin.set()
    assert closed.wait(60)
    assert not ordered
