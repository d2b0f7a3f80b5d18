"""The operator's screen, made to be read from two metres."""

from __future__ import annotations

from dataclasses import dataclass

from rich.console import Console, ConsoleOptions, Group, RenderResult
from rich.padding import Padding
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from triaxcal.model.positions import AXES
from triaxcal.rig.bigtext import big
from triaxcal.rig.events import View
from triaxcal.rig.orientation import described

_COLOURS = {
    "turn": "black on bright_yellow",
    "still": "black on bright_yellow",
    "settle": "bright_white on blue",
    "average": "bright_white on blue",
    "guard": "bright_white on blue",
    "reference": "bright_white on blue",
    "temperature": "black on cyan",
    "done": "black on bright_green",
}
_MARKS = {"done": ("[x]", "green"), "now": ("[>]", "bold"), "redo": ("[r]", "yellow"),
          "open": ("[ ]", "")}  # fmt: skip
_TALL = 30
"""Lines of a terminal that has room for big letters of twice the size."""
_KEYS = " y take what was found    1-6 take TP1-TP6 again    q stop (then: rig resume)"


@dataclass(frozen=True)
class BusView:
    """State of the connection: channel, frames and bits a second, frames the kernel dropped."""

    channel: str
    frames_per_s: float
    bits_per_s: float
    dropped: int
    bitrate: int


@dataclass(frozen=True)
class BigText:
    """A text in big letters, in bigger ones where the terminal has room for them."""

    text: str

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Lines in the middle; rich would centre each line separately."""
        tall = console.size.height >= _TALL
        lines = big(self.text, options.max_width, 2 if tall else 1)
        margin = " " * ((options.max_width - len(lines[0])) // 2)
        for line in lines:
            yield Text(margin + line, no_wrap=True, overflow="crop")
        if tall:
            yield Text()


def screen(view: View, bus: BusView, alarms: tuple[str, ...]) -> Group:
    """Everything the operator sees, for 80 columns and 24 lines or more."""
    done, whole = view.progress
    style = "bright_white on red" if alarms else _COLOURS[view.phase]
    headline = Text(view.headline, style="bold", justify="center")
    top = Padding(Group(BigText(view.order), headline), (1, 2), style=style)
    bar = ProgressBar(
        total=max(whole, 1), completed=done, complete_style="bold", finished_style="bold"
    )
    message = Text(
        " " + (alarms[-1] if alarms else view.last_event), overflow="ellipsis", no_wrap=False
    )
    message.stylize("bold red" if alarms else "")
    return Group(
        top, bar, _checklist(view), _axes(view), _status(view, bus), message, Text(_KEYS, "dim")
    )


def plain_status(view: View) -> str:
    """The headline and the temperature in one line."""
    temp = f"{view.temp_degc:.2f} degC" if view.temp_degc is not None else "no temperature"
    return f"{view.headline} | {temp} | {view.accepted}/{view.to_accept}"


def _checklist(view: View) -> Text:
    target = f"{view.target_degc:g} degC" if view.target_degc is not None else "done"
    line = Text(f"\n Step {min(view.step + 1, view.steps)}/{view.steps}, {target}:", style="bold")
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


def _status(view: View, bus: BusView) -> Text:
    temp = f"{view.temp_degc:.2f} degC" if view.temp_degc is not None else "-"
    slope = view.temp_slope_k_per_min
    trend = f"{slope:+.3f} K/min" if slope is not None else "slope: not yet"
    left = "-" if view.left_s is None else f"{view.left_s / 60:.0f} min"
    load = 100.0 * bus.bits_per_s / bus.bitrate
    lost = view.lost + bus.dropped
    line = Text(f"\n T {temp}, {trend}    time left about {left}\n", style="bold")
    line.append(
        f" {bus.channel}: {bus.frames_per_s:.0f} frames/s, load {load:.0f} %\n"
        f" lost samples {view.lost}, dropped by the kernel {bus.dropped}, bad CRC {view.bad_crc}\n",
        style="yellow" if lost or view.bad_crc else "",
    )
    return line
