"""The operator's screen in every state of a session: it fits, and says what to do."""

from __future__ import annotations

import io

import pytest
from rich.console import Console
from rig_cases import rig_of, short_setup

from triaxcal.rig.bigtext import big
from triaxcal.rig.engine import Engine
from triaxcal.rig.runner import Robot
from triaxcal.rig.screen import BusView, plain_status, screen
from triaxcal.rig.view import view

PHASES = {"reference", "temperature", "turn", "still", "settle", "average", "guard", "done"}
BUS = BusView("can0", 211.0, 26000.0, 3, 1_000_000)


def drawn(seen, alarms, width, height):
    """Lines of the screen, as a terminal of this size gets them."""
    out = io.StringIO()
    console = Console(file=out, width=width, height=height, force_terminal=False)
    console.print(screen(seen, BUS, alarms))
    return [line.rstrip() for line in out.getvalue().splitlines()]


@pytest.fixture(scope="module")
def states(tmp_path_factory):
    """A view of each phase."""
    setup = short_setup(tmp_path_factory.mktemp("screen"), temps="[20, 25]")
    engine, rig = Engine(setup, "test"), rig_of(setup)
    robot, found = Robot(rig), {}
    while not engine.session.done:
        engine.feed(rig.advance())
        robot.act(engine.session)
        now = view(engine.session)
        found.setdefault(now.phase, now)
    found["done"] = view(engine.session)
    return found


def test_every_phase_is_met(states):
    assert set(states) == PHASES


@pytest.mark.parametrize(("width", "height"), [(80, 24), (120, 40)])
@pytest.mark.parametrize("phase", sorted(PHASES))
def test_it_fits_and_tells(states, phase, width, height):
    seen = states[phase]
    for alarms in ((), ("TP1: slip of 38 micro-g on x at 41 s; u(A) of x is 5.4, retake",)):
        lines = drawn(seen, alarms, width, height)
        assert len(lines) <= height - 1
        assert all(len(line) <= width for line in lines)
        text = "\n".join(lines)
        assert seen.headline in text
        assert "Position seen:" in text
        assert "dropped by the kernel 3" in text
        assert not alarms or "slip of 38 micro-g" in text
    assert seen.headline in plain_status(seen)


@pytest.mark.parametrize(("width", "height", "scale"), [(80, 24, 1), (120, 40, 2)])
@pytest.mark.parametrize("phase", sorted(PHASES))
def test_the_order_stands_in_big_letters(states, phase, width, height, scale):
    """Every letter whole and in its place: the ink of the screen is the ink of the text."""
    lines = drawn(states[phase], (), width, height)
    letters = [line.rstrip() for line in big(states[phase].order, width - 4, scale)]
    at = next(i for i, line in enumerate(lines) if set(line) & set("█▀▄"))
    margin = len(lines[at]) - len(letters[0])
    assert lines[at : at + len(letters)] == [(" " * margin + text).rstrip() for text in letters]
    assert len(letters) == (5 if scale == 2 else 3)


def test_big_letters_are_their_ink():
    assert big("T.", 80, 1) == ["▀█▀  ", " █   ", " ▀  ▀"]
    assert [len(line) for line in big("DONE", 200, 3)] == [3 * 16] * 8
    # Every position's order fits into the smallest screen; too wide a text keeps the smallest size.
    for up in ("+X UP", "-Z UP TILTED"):
        for order in ("TURN TO", "RESEAT"):
            assert len(big(f"{order} {up}", 76, 2)[0]) <= 76
    assert len(big("HANDS OFF 3600", 76, 2)[0]) <= 76
    assert len(big("WAIT FOR -12.5", 76, 2)[0]) <= 76


def test_the_numbers_are_those_of_the_position(states):
    seen = states["average"]
    assert seen.mean_g is not None
    assert seen.sd_micro_g is not None
    # Nominal scale and bias are good to a few per cent: +1 g on z in TP1.
    assert seen.mean_g == pytest.approx((0.0, 0.0, 1.0), abs=0.05)
    # 7.8e-5 V of 0.55 V/g, from 500 readings or more: 142 micro-g within 5 deviations.
    assert seen.sd_micro_g == pytest.approx((142,) * 3, rel=5 / (2 * 500) ** 0.5)
    assert seen.temp_degc == pytest.approx(20.0, abs=0.1)
