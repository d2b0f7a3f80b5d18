"""Pictures of the screen of many units, to be looked at: `python draw_many.py FOLDER`.

SVG of some moments at 80x24 and 120x40; `rsvg-convert -w 900 X.svg -o X.png` makes what docs show.
"""

from __future__ import annotations

import io
import sys
import tempfile
from pathlib import Path

from many_cases import Run, bench_of, setup_of
from rich.console import Console
from rich.screen import Screen

from triaxcal.rig.many.screen import HELP, Recent, many_screen
from triaxcal.rig.screen.screen import faults_page, help_page

MOMENTS = {"reference": 31, "average": 90, "slip": 96, "dead": 232, "warming": 460}
ORDERS = ("AT-2/linkdown@150:1:99999", "AT-3/slip@84:150")


def draw(count: int, target: Path) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        setup = setup_of(folder, count, "[20, 25]")
        run = Run(setup, bench_of(setup, *ORDERS), folder / "001")
        recent = Recent()
        for tick in run.ticks:
            now = run.bench.seconds
            recent.add(now, tick)
            for moment, second in MOMENTS.items():
                if now == second:
                    for width, height in ((80, 24), (120, 40)):
                        view = many_screen(run.group, "001", "14:32", recent.alarm(now))
                        path = target / f"many-{count}-{moment}-{width}.svg"
                        path.write_text(svg(view, width, height), encoding="utf-8")
                    shown = {"help": help_page(HELP), "faults": faults_page(recent.faults, 9)}
                    for page, drawn in {**shown, "second": None}.items():
                        view = many_screen(run.group, "001", "14:32", "", page=drawn, scrolled=2)
                        path = target / f"many-{count}-{moment}-{page}.svg"
                        path.write_text(svg(view, 80, 24), encoding="utf-8")
            if now > max(MOMENTS.values()):
                break
        run.taken.close()
        run.sources.close()


def svg(view, width: int, height: int) -> str:
    console = Console(
        width=width, height=height, record=True, file=io.StringIO(), force_terminal=True,
        color_system="truecolor",
    )  # fmt: skip
    console.print(Screen(view))
    text = console.export_svg(title=f"triaxcal rig run, {width}x{height}")
    text = text.replace("Fira Code", "DejaVu Sans Mono")
    return text.replace("<text ", '<text xml:space="preserve" ')


if __name__ == "__main__":
    goal = Path(sys.argv[1])
    goal.mkdir(parents=True, exist_ok=True)
    for units in (8, 32):
        draw(units, goal)
