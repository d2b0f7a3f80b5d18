"""Pictures of the operator's screen, to be looked at: `python draw_screens.py FOLDER`.

SVG of every state at 80x24 and 120x40; `rsvg-convert -w 900 X.svg -o X.png` makes what docs show.
"""

from __future__ import annotations

import io
import sys
import tempfile
from pathlib import Path

from rich.console import Console, RenderableType
from rich.screen import Screen
from rig_cases import rig_of, short_setup

from triaxcal.rig.live.runner import Robot
from triaxcal.rig.screen.screen import About, BusView, Faults, faults_page, help_page, screen
from triaxcal.rig.screen.view import view
from triaxcal.rig.session.engine import Engine
from triaxcal.rig.session.events import View

BUS = BusView("can0", 211.0, 0.026, 0)
ABOUT = About("AT-SIM-BENCH", "AT-SIM-BENCH-001", "003", "16:42")
SLIP = "TP1: slip of 144 micro-g on x at 8 s, retake"


def phases(folder: Path) -> dict[str, View]:
    """A view of each phase of a session, some seconds into it."""
    setup = short_setup(folder, temps="[20, 25]")
    engine, rig = Engine(setup, "test"), rig_of(setup)
    robot, found, seconds = Robot(rig), {}, {}
    while not engine.session.done:
        engine.feed(rig.advance())
        robot.act(engine.session)
        now = view(engine.session)
        seconds[now.phase] = seconds.get(now.phase, 0) + 1
        if seconds[now.phase] <= 12:
            found[now.phase] = now
    return {**found, "done": view(engine.session)}


def exceptions(folder: Path) -> dict[str, View]:
    """A slip, and a position out of order."""
    setup = short_setup(folder, temps="[20]")
    slipped, rig = Engine(setup, "test"), rig_of(setup, "slip@84:150")
    for _ in range(110):
        slipped.feed(rig.advance())
    offered, rig = Engine(setup, "test"), rig_of(setup)
    rig.turn_to("TP4")
    for _ in range(121):
        offered.feed(rig.advance())
    return {"slip": view(slipped.session), "offer": view(offered.session)}


def svg(
    seen: View,
    alarms: tuple[str, ...],
    width: int,
    height: int,
    page: RenderableType | None = None,
) -> str:
    console = Console(
        width=width, height=height, record=True, file=io.StringIO(), force_terminal=True,
        color_system="truecolor",
    )  # fmt: skip
    console.print(Screen(screen(seen, BUS, alarms, ABOUT, page)))
    text = console.export_svg(title=f"triaxcal rig run, {width}x{height}")
    # Fonts of this machine in place of one from the network; blanks are meant.
    text = text.replace("Fira Code", "DejaVu Sans Mono")
    return text.replace("<text ", '<text xml:space="preserve" ')


def main(target: Path) -> None:
    target.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        states = phases(Path(folder)) | exceptions(Path(folder))
    faults = Faults()
    faults.add("14:02:11", [SLIP, "can0: no frames; is the rig on, the plug in, the bus up?"])
    pages = {"help": help_page(), "faults": faults_page(faults, 8)}
    for width, height in ((80, 24), (120, 40), (40, 12)):
        for name, seen in states.items():
            alarms = (SLIP,) if name == "slip" else ()
            (target / f"{name}-{width}.svg").write_text(svg(seen, alarms, width, height))
        for name, page in pages.items():
            text = svg(states["average"], (), width, height, page)
            (target / f"{name}-{width}.svg").write_text(text)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
