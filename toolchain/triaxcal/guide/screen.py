"""What the operator sees: what to do, how long still, and how far the constants are known."""

from __future__ import annotations

import math
import textwrap

from triaxcal.base.screentext import counted
from triaxcal.guide.goals import Standing
from triaxcal.guide.guide import Guide
from triaxcal.guide.turns import up_words

WIDTH = 78
_BAR, _WORDS = 20, 28
_MARK, _REST = "#", "."
_NOW = "  NOW   "


def bar(part: float) -> str:
    """A bar of text: full at 1."""
    done = math.floor(min(max(part, 0.0), 1.0) * _BAR + 1e-9)
    return f"[{_MARK * done}{_REST * (_BAR - done)}]"


def screen_lines(guide: Guide, unit: str, seconds: float) -> list[str]:
    """Lines of at most `WIDTH` characters."""
    minutes, rest = divmod(int(seconds), 60)
    head = f"{unit}   {minutes} min {rest:02d} s   {counted(guide.rests, 'rest')}"
    return [head[:WIDTH], "", *_order_lines(guide), "", *_goal_lines(guide)]


def _order_lines(guide: Guide) -> list[str]:
    if guide.done is not None:
        return ["  DONE  every demand is met, by a calibration of this recording"]
    advice, up = guide.advice, guide.up
    order = textwrap.wrap(advice.words, WIDTH - len(_NOW))
    lines = [(_NOW if k == 0 else " " * len(_NOW)) + line for k, line in enumerate(order)]
    lines.append(f"{' ' * len(_NOW)}then hold it still for {advice.hold_s:.0f} s")
    if advice.target is not None:
        lines.append(f"{' ' * len(_NOW)}for the {advice.target.goal.words}")
    lines.append("")
    if guide.resting_s and up is not None:
        part = guide.resting_s / advice.hold_s
        if guide.held:
            lines.append(f"  {up_words(up)}, and still: go on with the above")
        else:
            lines.append(f"  {up_words(up)}, still  {bar(part)}  {guide.resting_s:.0f} s")
    else:
        lines.append("  moving")
    if guide.refusal:
        lines.append("  the recording so far cannot be calibrated:")
        lines += [f"    {line[: WIDTH - 4]}" for line in textwrap.wrap(guide.refusal, WIDTH - 4)]
    return lines


def _goal_lines(guide: Guide) -> list[str]:
    lines = [f"{'standard deviation':{_WORDS}}{'expected':>9}{'demand':>9}"]
    return [*lines, *(_goal_line(s) for s in guide.standings)]


def _goal_line(standing: Standing) -> str:
    goal = standing.goal
    text = f"{goal.words:{_WORDS}}{_number(standing.sd):>9}"
    if math.isinf(goal.demand):
        return f"{text}{'-':>9} {goal.unit}"
    text += f"{_number(goal.demand):>9} {goal.unit:8}"
    return f"{text}{bar(standing.way)}"[:WIDTH]


def _number(value: float) -> str:
    """Three digits, without an exponent."""
    if value == 0.0:
        return "0"
    places = max(0, 2 - math.floor(math.log10(abs(value))))
    return f"{value:.{min(places, 6)}f}"


def status_line(guide: Guide) -> str:
    """The order in one line, for logs: the same words every time nothing has changed."""
    if guide.done is not None:
        return "done: every demand is met"
    advice = guide.advice
    text = f"{advice.words}; then hold it still for {advice.hold_s:.0f} s"
    if advice.target is None:
        return text
    target = advice.target
    sd, demand = _number(target.sd), _number(target.goal.demand)
    return f"{text} ({target.goal.words}: {sd} of {demand} {target.goal.unit})"
