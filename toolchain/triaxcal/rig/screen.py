"""The operator's screen, made to be read from two metres."""

from __future__ import annotations

from dataclasses import dataclass

from rich.console import Group
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from triaxcal.model.positions import AXES
from triaxcal.rig.events import View
from triaxcal.rig.orientation import described

_COLOURS = {
    "turn": "black on bright_yellow",
    "still": "black on bright_yellow",
    "settle": "white on blue",
    "average": "white on blue",
    "guard": "white on blue",
    "reference": "white on blue",
    "temperature": "black on cyan",
    "done": "black on bright_green",
}
_MARKS = {"done": ("[x]", "green"), "now": ("[>]", "bold"), "redo": ("[r]", "yellow"),
          "open": ("[ ]", "")}  # fmt: skip
_KEYS = " y take what was found    1-6 take TP1-TP6 again    q stop (then: rig resume)"


@dataclass(frozen=True)
class BusView:
    """State of the connection: channel, frames and bits a second, frames the kernel dropped."""

    channel: str
    frames_per_s: float
    bits_per_s: float
    dropped: int
    bitrate: int


def screen(view: View, bus: BusView, alarms: tuple[str, ...]) -> Group:
    """Everything the operator sees, for 80 columns and 24 lines or more."""
    done, whole = view.progress
    style = "white on red" if alarms else _COLOURS[view.phase]
    top = Panel(Text(view.headline, style="bold", justify="center"), style=style, padding=(1, 1))
    bar = ProgressBar(total=max(whole, 1), completed=done)
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
    target = f"{view.target_degc:g} degC" if view.target_degc is not None else "all temperatures"
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
