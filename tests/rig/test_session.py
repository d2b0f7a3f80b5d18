"""The guided session on the simulated rig: what it accepts, refuses, offers and says."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from rig_cases import bench_unit, play, rig_of, short_setup

from triaxcal.base.errors import RefusedError, UsageError
from triaxcal.rig.hands.orientation import recognised
from triaxcal.rig.plan.plan import read_plan
from triaxcal.rig.screen.view import view
from triaxcal.rig.session.engine import Engine, Setup
from triaxcal.rig.session.events import Agree, Redo
from triaxcal.rig.simulated.simorders import read_fault
from triaxcal.simulation.tilts import truth_force_g

# Of the short plan: the noise is learned in 60 s, then TP1 rests from about 65 s on.
LEARNED = 61


def texts(events, kind):
    return [e.text for e in events if e.kind == kind]


def run(setup, *orders, accepted=None):
    engine = Engine(setup, "test")
    return engine, play(rig_of(setup, *orders), engine.feed, engine.session, accepted=accepted)


@pytest.fixture(scope="module")
def clean_start_ns(tmp_path_factory):
    """Start of the first average when nothing goes wrong."""
    setup = short_setup(tmp_path_factory.mktemp("clean"), temps="[20]")
    return run(setup, accepted=1)[0].session.accepted[0, "TP1"].start_ns


@pytest.mark.parametrize("layout", ["classic", "fd"])
def test_a_session_without_faults(tmp_path, layout):
    setup = short_setup(tmp_path, layout=layout)
    engine, events = run(setup)
    assert len(texts(events, "accepted")) == 12
    assert texts(events, "refused") == texts(events, "trouble") == []
    assert engine.session.lost == 0
    order = [(e.step, e.dwell.position) for e in events if e.kind == "accepted"]
    assert order == [(step, f"TP{k}") for step in range(2) for k in range(1, 7)]


@pytest.mark.parametrize(
    ("order", "kind", "said"),
    [
        ("slip@84:150", "refused", r"TP1: slip of 1\d\d micro-g on x at \d+ s"),
        ("nudge@82:20", "refused", r"TP1: shaken: variance on x .* retake"),
        ("lose@82.1:160", "trouble", r"7\d of 100 samples lost in 1 s"),
        ("lose@82.1:70", "refused", r"TP1: 3\d of 2000 samples lost, retake"),
        ("linkdown@82:1:4", "trouble", r"gap of [34] s or more without samples"),
        ("gone@82:1:4", "trouble", r"gap of \d s|the counters jumped: the rig restarted"),
        ("busoff@82:1:3", "trouble", r"error frames: bus-off"),
        ("twonodes@82:1:4", "trouble", r"another node sends under the rig's IDs"),
        ("clipped@82:1:2", "trouble", r"clipped: 100 samples at the end of the ADC's range"),
        ("stuck@82:1:2", "trouble", r"stuck: y gives the same code all the time"),
        ("status@82:2:2", "trouble", r"the rig reports status 0x02"),
        ("notemp@82:1:3", "trouble", r"no temperature from the rig"),
        ("creep@66:900:10", "refused", r"TP1: creep of \d+ micro-g with about 10 s on x, retake"),
    ],
)
def test_a_fault_in_the_averaging_is_found_named_and_outlived(
    tmp_path, clean_start_ns, order, kind, said
):
    setup = short_setup(tmp_path, temps="[20]")
    engine, events = run(setup, order, accepted=1)
    assert [t for t in texts(events, kind) if re.search(said, t)], events
    assert any(t.startswith("TP1: ") for t in texts(events, "refused"))
    # Every reading of the accepted average is from after the fault.
    assert engine.session.accepted[0, "TP1"].start_ns > max(clean_start_ns, 82 * 10**9)


@pytest.mark.parametrize(
    ("order", "lost", "bad_crc"),
    [("duplicate@82.1:8", {0}, 0), ("bitflip@82.1:8", {4, 5}, 8), ("error@82.1:5", {0}, 0)],
)
def test_what_costs_no_more_than_a_few_samples_is_counted(tmp_path, order, lost, bad_crc):
    engine, events = run(short_setup(tmp_path, temps="[20]"), order, accepted=1)
    assert texts(events, "refused") == []
    told = ["5 error frames: protocol violation"] if order.startswith("error") else []
    assert texts(events, "trouble") == told
    dwell = engine.session.accepted[0, "TP1"]
    assert dwell.lost in lost
    assert dwell.bad_crc == bad_crc


def test_a_chamber_that_cycles_is_waited_for_when_its_period_is_stated(tmp_path):
    """+-0.5 K in the chamber each 40 s, which the unit follows with 5 s; 0.3 K/min is rest."""
    setup = short_setup(tmp_path, temps="[20]")
    text = Path(setup.plan.source).read_text()
    stated = tmp_path / "stated.toml"
    stated.write_text(text + "cycle_s = 40\nspan_max_k = 1.5\n")
    cycle = {"cycle_k": 0.5, "cycle_s": 40.0}
    engine = Engine(setup, "test")
    events = advance(engine, rig_of(setup, **cycle), 150)
    assert texts(events, "equilibrium") == []
    again = Setup(setup.folder, setup.unit, read_plan(stated, setup.unit), setup.rig)
    events = advance(Engine(again, "test"), rig_of(again, **cycle), 150)
    assert len(texts(events, "equilibrium")) == 1


def test_another_serial_number_is_refused(tmp_path):
    setup = short_setup(tmp_path)
    with pytest.raises(RefusedError, match=r'expected "AT-SIM-BENCH-001" \(0x') as refusal:
        run(setup, "serial@30")
    assert "mount that unit" in str(refusal.value)


def test_another_rate_is_refused(tmp_path):
    setup, other = short_setup(tmp_path, rate=100), None
    (tmp_path / "b").mkdir()
    other = short_setup(tmp_path / "b", rate=200)
    with pytest.raises(RefusedError, match="200 samples a second; expected 100"):
        Engine(setup, "test").feed(rig_of(other).advance())


def advance(engine, rig, seconds):
    return [e for _ in range(seconds) for e in engine.feed(rig.advance())]


def test_a_position_out_of_order_is_offered_and_taken_when_agreed(tmp_path):
    setup = short_setup(tmp_path, temps="[20]")
    engine, rig = Engine(setup, "test"), rig_of(setup)
    rig.turn_to("TP4")
    events = advance(engine, rig, LEARNED + 60)
    assert texts(events, "offer") == [
        "found TP4 (+Y up), wanted TP1 (+Z up): accept it (y), or turn"
    ]
    assert view(engine.session).phase == "turn"
    assert "or press y to take TP4 (+Y up) now" in view(engine.session).headline
    assert engine.command(Agree(), 0) == []
    events = advance(engine, rig, 50)
    assert [e.dwell.position for e in events if e.kind == "accepted"] == ["TP4"]
    assert engine.session.wanted == "TP1"


def test_a_position_out_of_order_is_taken_at_once_when_the_plan_says_so(tmp_path):
    setup = short_setup(tmp_path, temps="[20]", take="true")
    engine, rig = Engine(setup, "test"), rig_of(setup)
    rig.turn_to("TP4")
    events = advance(engine, rig, LEARNED + 80)
    assert texts(events, "found") == ["found TP4 (+Y up) instead of TP1: taken out of order"]
    assert [e.dwell.position for e in events if e.kind == "accepted"] == ["TP4"]


def test_after_a_slip_the_position_has_to_be_taken_up_anew(tmp_path):
    setup = short_setup(tmp_path, temps="[20]")
    engine, rig = Engine(setup, "test"), rig_of(setup, "slip@84:150")
    events = advance(engine, rig, LEARNED + 120)
    assert len(texts(events, "refused")) == 1
    assert texts(events, "accepted") == []
    assert view(engine.session).headline == "TURN AWAY FROM TP1 (+Z up) AND BACK - it slipped"
    rig.turn_to("TP2")
    advance(engine, rig, 6)
    rig.turn_to("TP1")
    assert len(texts(advance(engine, rig, 50), "accepted")) == 1


def test_what_lay_through_a_change_of_temperature_is_taken_up_anew(tmp_path):
    """A slip on the way has nothing before it to be seen against."""
    setup = short_setup(tmp_path, temps="[25]")
    engine, rig = Engine(setup, "test"), rig_of(setup)
    rig.target_degc = 25.0
    events = advance(engine, rig, LEARNED + 150)
    (text,) = texts(events, "equilibrium")
    assert text.endswith("degC; turn away from TP1 (+Z up) and back")
    assert texts(events, "accepted") == []
    now = view(engine.session)
    assert now.headline == "TURN AWAY FROM TP1 (+Z up) AND BACK - its temperature changed by 5 K"
    assert (now.phase, now.order) == ("turn", "RESEAT +Z UP")
    rig.turn_to("TP2")
    advance(engine, rig, 6)
    rig.turn_to("TP1")
    assert len(texts(advance(engine, rig, 50), "accepted")) == 1


def test_what_was_taken_up_at_temperature_is_not_taken_up_twice(tmp_path):
    setup = short_setup(tmp_path, temps="[25]")
    engine, rig = Engine(setup, "test"), rig_of(setup)
    rig.target_degc = 25.0
    advance(engine, rig, 30)
    rig.turn_to("TP2")
    advance(engine, rig, 8)
    rig.turn_to("TP1")
    events = advance(engine, rig, LEARNED + 100)
    assert "anew" not in texts(events, "equilibrium")[0]
    assert len(texts(events, "accepted")) == 1


def test_a_redo_supersedes(tmp_path):
    setup = short_setup(tmp_path, temps="[20]")
    engine, rig = Engine(setup, "test"), rig_of(setup)
    events = advance(engine, rig, LEARNED + 60)
    first = engine.session.accepted[0, "TP1"]
    assert texts(engine.command(Redo("TP1"), 0), "found") == ["TP1 will be measured again"]
    events = advance(engine, rig, 60)
    second = engine.session.accepted[0, "TP1"]
    assert second.start_ns > first.end_ns
    assert len(texts(events, "superseded")) == 1
    assert engine.session.wanted == "TP2"


@pytest.mark.parametrize(
    ("position", "said"),
    [("TP2", "TP2 has not been accepted at this temperature"), ("TP9", "no position 'TP9'")],
)
def test_a_redo_of_nothing_is_refused(tmp_path, position, said):
    engine = Engine(short_setup(tmp_path), "test")
    assert texts(engine.command(Redo(position), 0), "refused") == [said]
    assert texts(engine.command(Agree(), 0), "refused") == ["no position is offered"]


def test_a_temperature_that_moves_between_positions_costs_the_older_ones(tmp_path):
    """0.3 K after the second position: the first two are to be taken again."""
    setup = short_setup(tmp_path, temps="[20]")
    engine, rig = Engine(setup, "test"), rig_of(setup)
    while len(engine.session.accepted) < 2:
        engine.feed(rig.advance())
        rig.turn_to(engine.session.wanted)
    rig.target_degc = 20.35
    events = []
    while len(texts(events, "accepted")) < 1:
        events += engine.feed(rig.advance())
        rig.turn_to(engine.session.wanted)
    assert len(texts(events, "superseded")) == 2
    assert [p for _, p in engine.session.accepted] == ["TP3"]
    temps = [d.temp_degc for d in engine.session.accepted.values()]
    assert max(temps) - min(temps) <= setup.plan.thermal.span_max_k


def test_the_constants_come_back(tmp_path):
    """Means of the simulated session against the exact truth, within five u."""
    setup = short_setup(tmp_path, temps="[20, 25]")
    engine, _ = run(setup, "slip@84:150", "twonodes@130:1:3", "bitflip@170:9")
    rig = rig_of(setup)
    for dwell in engine.session.accepted.values():
        force = truth_force_g(dwell.position, setup.unit.gravity_g)
        exact = rig._truth.voltage_v(force, dwell.temp_degc) / setup.unit.adc.volts_per_code
        # u from ten batch means: Student's t, 9 degrees of freedom, 36 axes, once in 1000.
        assert np.all(np.abs(np.array(dwell.mean_code) - exact) < 8.2 * np.array(dwell.u_code))


def test_positions_are_recognised():
    scale = short_scale()
    unit = bench_unit()
    for k in range(1, 7):
        for kind in "TC":
            force = truth_force_g(f"{kind}P{k}", unit.gravity_g)
            assert recognised(force * 1e6 / scale, scale) == f"{kind}P{k}"
    assert recognised(np.array([0.6, 0.6, 0.5]) * 1e6 / scale, scale) is None


def short_scale():
    return 1e6 * bench_unit().adc.volts_per_code / np.array([-0.55, -0.55, -0.55])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            ("[20, 25]", "[20, 85]"),
            r"\[steps\] temperatures_degc: found 85 degC; expected .*-40 to",
        ),
        (("batches = 10", "batches = 7"), r"\[stillness\] batches: found 7; expected a divisor"),
        (("rate_hz = 100", "rate_hz = 1"), r"\[rig\] rate_hz: found 1; expected a whole number"),
        (("settle_s", "setle_s"), r'unknown: \[stillness\] setle_s \(did you mean "settle_s"\?\)'),
        (('"classic"', '"clasic"'), r'did you mean "classic"'),
        (("[-0.55,", "[0,"), "three signed numbers"),
        (("= false", "= 1"), "expected true or false"),
    ],
)
def test_a_wrong_plan_is_refused(tmp_path, change, said):
    setup = short_setup(tmp_path)
    path = tmp_path / "short.toml"
    text = path.read_text()
    assert change[0] in text
    path.write_text(text.replace(*change))
    with pytest.raises(RefusedError, match=said):
        read_plan(path, setup.unit)


@pytest.mark.parametrize("order", ["slip", "slid@3", "slip@x", "slip@1.2.3"])
def test_a_wrong_fault_is_refused(order):
    with pytest.raises(UsageError, match="--fault: found"):
        read_fault(order)
