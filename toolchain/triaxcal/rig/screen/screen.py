"""The operator's screen, made to be read from two metres."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field

from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.padding import Padding
from rich.progress_bar import ProgressBar
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from triaxcal.model.positions import AXES
from triaxcal.rig.hands.orientation import described
from triaxcal.rig.screen.bigtext import big
from triaxcal.rig.session.events import View

ALARM = "bright_white on #a53e00"
_DO, _LEAVE = "black on #f0e442", "bright_white on #0072b2"
COLOURS = {
    "turn": _DO,
    "still": _DO,
    "settle": _LEAVE,
    "average": _LEAVE,
    "guard": _LEAVE,
    "reference": _LEAVE,
    "temperature": "black on #56b4e9",
    "done": "black on #cccccc",
}
"""Colours that the colour-blind tell apart (Okabe and Ito 2008); words say the same."""
_MARKS = {"done": ("[x]", "dim"), "now": ("[>]", "bold reverse"), "redo": ("[r]", "bold"),
          "open": ("[ ]", "")}  # fmt: skip
_TALL = 30
"""Lines of a terminal that has room for big letters of twice the size."""
_KEYS = " y take what was found  1-6 TP again  c 1-6 CP again  f faults  ? help  q stop"
_FAULTS = 200
HELP = (
    ("y", "take the position that was found, out of the plan's order"),
    ("1 to 6", "measure TP1 to TP6 of this temperature again; the new dwell replaces the old one"),
    ("c, 1 to 6", "the same of the check positions CP1 to CP6"),
    ("f", "list what was refused and what went wrong; f again goes back"),
    ("?", "this page; ? again goes back"),
    ("q", "stop; `triaxcal rig resume` goes on, accepted dwells are kept"),
)
"""Keys of the operator, and what they do."""


@dataclass(frozen=True)
class BusView:
    """State of the connection.

    Attributes
    ----------
    channel : str
    frames_per_s : float
    load : float or None
        Part of the time that the bus is busy, 0 to 1; None where its bit rate is not known.
    dropped : int
        Frames that the kernel dropped.
    """

    channel: str
    frames_per_s: float
    load: float | None
    dropped: int


@dataclass(frozen=True)
class About:
    """What the session is about: unit, serial number, its folder's name, clock time of the end."""

    unit: str
    serial: str
    session: str
    ends: str


@dataclass
class Faults:
    """What was refused and what went wrong, with its clock time.

    Attributes
    ----------
    listed : deque of (str, str)
        Clock time and text, the last ones of the session.
    """

    listed: deque[tuple[str, str]] = field(default_factory=lambda: deque(maxlen=_FAULTS))

    def add(self, clock: str, texts: Iterable[str]) -> None:
        """List some more; the same again takes the place of the one before."""
        for text in texts:
            if self.listed and self.listed[-1][1] == text:
                self.listed.pop()
            self.listed.append((clock, text))


@dataclass(frozen=True)
class BigText:
    """A text in big letters, in bigger ones where the terminal has room for them."""

    text: str

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Lines in the middle; rich would centre each line separately."""
        tall = console.size.height >= _TALL
        lines = big(self.text, options.max_width, 2 if tall else 1)
        if len(lines[0]) > options.max_width:  # half an order would be a wrong one
            yield Text(self.text, "bold", justify="center")
            return
        margin = " " * ((options.max_width - len(lines[0])) // 2)
        for line in lines:
            yield Text(margin + line, no_wrap=True, overflow="crop")
        if tall:
            yield Text()


@dataclass(frozen=True)
class Fitted:
    """Parts from top to bottom; where the terminal is too small, the least important go first."""

    parts: tuple[tuple[int, RenderableType], ...]

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Those parts that there is room for; a lower number is more important."""
        drawn = [
            console.render_lines(part, options.update(height=None), pad=False)
            for _, part in self.parts
        ]
        shown = list(range(len(self.parts)))
        while sum(len(drawn[i]) for i in shown) > console.size.height - 1 and len(shown) > 1:
            shown.remove(max(shown, key=lambda i: self.parts[i][0]))
        for line in (line for i in shown for line in drawn[i]):
            yield from line
            yield Segment.line()


def screen(
    view: View,
    bus: BusView,
    alarms: tuple[str, ...],
    about: About,
    page: RenderableType | None = None,
) -> Fitted:
    """Everything the operator sees, for 80 columns and 24 lines or more.

    Parameters
    ----------
    alarms : tuple of str
        What is wrong now, the newest last.
    page : renderable, optional
        `help_page` or `faults_page`, in place of the readings.
    """
    done, whole = view.progress
    style = ALARM if alarms else COLOURS[view.phase]
    headline = Text(view.headline, style="bold", justify="center")
    bar = ProgressBar(
        total=max(whole, 1), completed=done, complete_style="bold", finished_style="bold"
    )
    more = f" (and {len(alarms) - 1} more: f)" if len(alarms) > 1 else ""
    said = f" ALARM: {alarms[-1]}{more}" if alarms else f" {view.last_event}"
    message = Text(said, style="bold" if alarms else "")
    readings: tuple[tuple[int, RenderableType], ...] = (
        (6, _axes(view)),
        (5, _status(view, bus, about)),
    )
    if page is not None:
        readings = ((5, page),)
    return Fitted(
        (
            (4, _title(about)),
            (2, Padding(BigText(view.order), (1, 2, 0, 2), style=style)),
            (0, Padding(headline, (0, 2), style=style)),
            (7, bar),
            (1, message),
            (3, _checklist(view)),
            *readings,
            (8, Text(_KEYS, "dim", no_wrap=True, overflow="ellipsis")),
        )
    )


def help_page(keys: Iterable[tuple[str, str]] = HELP) -> RenderableType:
    """What the keys do."""
    table = Table(box=None, padding=(0, 1), title=" Keys", title_justify="left")
    table.add_column(style="bold", no_wrap=True)
    table.add_column()
    for key, what in keys:
        table.add_row(key, what)
    return table


def faults_page(faults: Faults, lines: int) -> RenderableType:
    """The last faults, the newest first."""
    last = list(reversed(faults.listed))[:lines]
    if not last:
        return Text(" No faults so far.")
    table = Table(box=None, padding=(0, 1), title=" Faults, the newest first", title_justify="left")
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True, overflow="ellipsis")
    for clock, text in last:
        table.add_row(clock, text)
    return table


def _title(about: About) -> Text:
    line = f" {about.unit}   serial {about.serial}   session {about.session}"
    return Text(line, style="bold", no_wrap=True, overflow="ellipsis")


def plain_status(view: View) -> str:
    """The headline and the temperature in one line."""
    temp = f"{view.temp_degc:.2f} degC" if view.temp_degc is not None else "no temperature"
    return f"{view.headline} | {temp} | {view.accepted}/{view.to_accept}"


def _checklist(view: View) -> Text:
    target = f"{view.target_degc:g} degC" if view.target_degc is not None else "done"
    line = Text(f" Step {min(view.step + 1, view.steps)}/{view.steps}, {target}:", style="bold")
    for position, state in view.checklist:
        mark, style = _MARKS[state]
        line.append(f"  {mark} {position}", style=style)
    seen = described(view.seen) if view.seen else "none"
    line.append(f"\n Position seen: {seen}   accepted in all: {view.accepted}/{view.to_accept}\n")
    return line


def _axes(view: View) -> Table:
    table = Table(box=None, expand=True, padding=(0, 1))
    for title in ("", "mean, g", "sd, micro-g", "slope, micro-g/min", "u(A), micro-g"):
        table.add_column(title, justify="right")
    for i, axis in enumerate(AXES):
        table.add_row(
            Text(axis, style="bold"),
            f"{view.mean_g[i]:+.6f}" if view.mean_g else "-",
            f"{view.sd_micro_g[i]:.0f}" if view.sd_micro_g else "-",
            f"{view.slope_micro_g_per_min[i]:+.1f}" if view.slope_micro_g_per_min else "-",
            f"{view.u_micro_g[i]:.1f}" if view.u_micro_g else "-",
        )
    return table


def _status(view: View, bus: BusView, about: About) -> Text:
    temp = f"{view.temp_degc:.2f} degC" if view.temp_degc is not None else "-"
    slope = view.temp_slope_k_per_min
    trend = f"{slope:+.3f} K/min" if slope is not None else "slope: not yet"
    left = "-" if view.left_s is None else f"{view.left_s / 60:.0f} min, ends {about.ends}"
    load = "not known, no bit rate" if bus.load is None else f"{100.0 * bus.load:.0f} %"
    line = Text(f"\n T {temp}, {trend}    time left about {left}\n", style="bold")
    line.append(
        f" {bus.channel}: {bus.frames_per_s:.0f} frames/s, load {load}\n"
        f" lost samples {view.lost}, dropped by the kernel {bus.dropped}, bad CRC {view.bad_crc}",
        style="bold" if view.lost or bus.dropped or view.bad_crc else "",
    )
    return line
