"""The operator's screen in every state of a session: it fits, and says what to do."""

from __future__ import annotations

import io
import re
import time
from dataclasses import replace
from itertools import combinations

import pytest
from rich.console import Console
from rich.style import Style
from rig_cases import rig_of, short_setup

from triaxcal.cli.rig_live import Operator, clock_of_end
from triaxcal.rig.live.runner import Robot
from triaxcal.rig.screen.bigtext import big
from triaxcal.rig.screen.screen import (
    ALARM,
    COLOURS,
    HELP,
    About,
    BusView,
    Faults,
    faults_page,
    help_page,
    plain_status,
    screen,
)
from triaxcal.rig.screen.view import view
from triaxcal.rig.session.engine import Engine
from triaxcal.rig.session.events import Agree, Redo

PHASES = {"reference", "temperature", "turn", "still", "settle", "average", "guard", "done"}
BUS = BusView("can0", 211.0, 0.026, 3)
ABOUT = About("AT-7", "SN-0815", "003", "16:42")


def drawn(seen, alarms, width, height, page=None):
    """Lines of the screen, as a terminal of this size gets them."""
    out = io.StringIO()
    console = Console(file=out, width=width, height=height, force_terminal=False)
    console.print(screen(seen, BUS, alarms, ABOUT, page))
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


@pytest.mark.parametrize(("width", "height"), [(40, 12), (60, 8), (30, 20), (20, 10)])
@pytest.mark.parametrize("phase", sorted(PHASES))
def test_a_small_terminal_keeps_the_order_and_the_alarm(states, phase, width, height):
    seen = states[phase]
    lines = drawn(seen, ("first", "TP1: slip of 38 micro-g on x"), width, height)
    assert len(lines) <= height - 1
    text = " ".join(" ".join(line.split()) for line in lines)
    assert "ALARM: TP1: slip of 38 micro-g on x (and 1 more: f)" in text
    assert seen.headline in text


def test_unit_serial_session_and_end_are_shown(states):
    text = "\n".join(drawn(states["average"], (), 80, 24))
    assert "AT-7   serial SN-0815   session 003" in text
    assert re.search(r"time left about \d+ min, ends 16:42", text)
    assert "load 3 %" in text
    assert "q stop" in text
    console = Console(file=io.StringIO(), width=80, height=24)
    console.print(screen(states["average"], replace(BUS, load=None), (), ABOUT))
    assert "load not known, no bit rate" in console.file.getvalue()


def test_pages_take_the_place_of_the_readings(states):
    faults = Faults()
    assert "No faults so far" in "\n".join(
        drawn(states["turn"], (), 80, 24, faults_page(faults, 9))
    )
    for i in range(300):
        faults.add(f"10:00:{i % 60:02d}", [f"fault {i // 2}"])
    text = "\n".join(drawn(states["turn"], (), 80, 24, faults_page(faults, 9)))
    assert [int(n) for n in re.findall(r"fault (\d+)", text)] == list(range(149, 140, -1))
    text = "\n".join(drawn(states["turn"], ("slip",), 80, 24, help_page()))
    assert "mean, g" not in text
    assert "ALARM: slip" in text
    for key, _ in HELP:
        assert re.search(rf"^ +{re.escape(key)}  ", text, re.MULTILINE)


def test_colours_differ_for_the_colour_blind():
    """Backgrounds, by the luminance and the blue-yellow axis, which every common kind keeps."""
    found = {}
    for name, style in {"alarm": ALARM, **COLOURS}.items():
        colour = Style.parse(style).bgcolor
        assert colour is not None
        r, g, b = (v / 255 for v in colour.get_truecolor())
        found[(round(0.2126 * r + 0.7152 * g + 0.0722 * b, 3), round(b - (r + g) / 2, 3))] = name
    assert len(found) == 5  # do, leave, wait, done, alarm
    for one, other in combinations(found, 2):
        assert abs(one[0] - other[0]) > 0.15 or abs(one[1] - other[1]) > 0.3, (one, other)


class _Typed:
    def __init__(self, *keys):
        self.left = list(keys)

    def pressed(self):
        return self.left.pop(0) if self.left else ""


def test_keys_say_what_the_operator_wants():
    operator = Operator(_Typed("y", "1", "c", "6", "c3", "4x", "?", "", "?f", "h"))
    words = [operator.words() for _ in range(6)]
    assert words == [[Agree()], [Redo("TP1")], [], [Redo("CP6")], [Redo("CP3")], [Redo("TP4")]]
    pages = []
    for _ in range(4):
        assert operator.words() == []
        pages.append(operator.page)
    assert pages == ["help", "help", "faults", "help"]


def test_the_end_has_its_day_where_it_is_another_one():
    noon = time.mktime((2026, 1, 30, 12, 0, 0, 0, 0, -1))
    assert clock_of_end(noon, 3600.0) == "13:00"
    assert clock_of_end(noon, 86400.0) == time.strftime("%a 12:00", time.localtime(noon + 86400))
    assert clock_of_end(noon, None) == "-"


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
