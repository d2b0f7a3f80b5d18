"""A design in words, and as a plan for the rig."""

from __future__ import annotations

import math

from triaxcal.base.screentext import table
from triaxcal.design.problem import Problem
from triaxcal.design.search import Design

_BATCHES = 10
_U_MARGIN = 1.75
"""u(A) of ten batch means scatters by 24 %: three times that is accepted."""


def comparison(problem: Problem, usual: Design, found: Design) -> str:
    """Both plans side by side, what the shorter saves, and what can be observed."""
    rows = [
        ("", "usual", "this plan"),
        ("temperatures", *(str(len(d.temps_degc)) for d in (usual, found))),
        ("averaging, s a dwell", *(str(d.dwell_s) for d in (usual, found))),
        ("95 % of a, micro-g", *(f"{d.expanded_g * 1e6:.3g}" for d in (usual, found))),
        ("chamber time", *(_duration(d.chamber_s) for d in (usual, found))),
    ]
    lines = table(rows[0], rows[1:])
    saved = 1.0 - found.chamber_s / usual.chamber_s
    than = "less" if saved >= 0 else "more"
    degrees = ", ".join(f"{t:g}" for t in found.temps_degc)
    lines += [
        "",
        f"measure at {degrees} degC, six positions, {found.dwell_s} s each",
        f"{100 * abs(saved):.0f} % {than} chamber time than the usual plan",
        "",
        *observability(problem, found),
    ]
    return "\n".join(lines)


def observability(problem: Problem, found: Design) -> list[str]:
    """What the plan determines, what checks it and what no plan of this kind shows."""
    count, order = len(found.temps_degc), problem.order
    spare = count - order - 1
    return [
        "Six positions determine all twelve constants at each temperature.",
        "Two residuals of each output are left: they show noise, and half of the squareness.",
        f"{count} temperatures determine polynomials of order {order}, with {spare} to spare.",
        "So the curve can be predicted at a held-out temperature, and a wrong order shows.",
        "No plan of this kind shows the tilter's level and alignment as a whole, local",
        "gravity, the thermometer's scale or hysteresis. State their uncertainty.",
    ]


def rig_plan(problem: Problem, found: Design, command: str) -> str:
    """The plan as a session of the rig takes it."""
    u_g = math.sqrt(problem.reading_g**2 / (problem.rate_hz * found.dwell_s) + problem.floor_g**2)
    volts = ", ".join(f"{v:g}" for v in problem.volts_per_g)
    degrees = ", ".join(f"{t:g}" for t in found.temps_degc)
    return f"""# Made by `{command}`: {found.expanded_g * 1e6:.3g} micro-g (95 %) of noise and
# repeatability in {_duration(found.chamber_s)} of chamber time.
format = 1

[rig]
rate_hz = {problem.rate_hz}
volts_per_g = [{volts}]

[steps]
temperatures_degc = [{degrees}]

[stillness]
average_s = {found.dwell_s}
batches = {_BATCHES}
u_max_micro_g = {max(_U_MARGIN * u_g * 1e6, 0.01):.3g}
allan_floor_micro_g = {problem.floor_g * 1e6:g}
"""


def _duration(seconds: float) -> str:
    minutes = round(seconds / 60.0)
    return f"{minutes // 60} h {minutes % 60:02d} min"
