"""What `triaxcal crosscoupling` prints, all at once and position after position; its picture."""

from __future__ import annotations

import numpy as np

from triaxcal.base.screentext import table
from triaxcal.fitting.pair.cross_coupling import PairFit
from triaxcal.fitting.pair.model import KIP, NAMES, UNITS, names_of
from triaxcal.fitting.pair.recursion import (
    DOF_MIN,
    SURPRISE,
    PairEstimate,
    Recursion,
    believed,
    converged_at,
)
from triaxcal.report.pictures.line_plot import COLOURS, Line, Panel, line_plot

_ARCSEC_PER_RAD = 180.0 * 3600.0 / np.pi


def pair_text(fit: PairFit, recursion: Recursion, mounting: str) -> str:
    """The coefficients with sd, and when they had settled."""
    names = names_of(mounting)[: len(fit.values)]
    rows = [
        [f"  {name}", *_coefficient(fit.values[k], fit.sd[k], UNITS[k])]
        for k, name in enumerate(names)
    ]
    rms = float(np.sqrt(np.mean(fit.residual_g2**2)))
    count, settled = len(fit.residual_g2), converged_at(recursion)
    kind, cubic = names[4][:3], len(names) == len(NAMES)
    lines = [
        *table(["coefficients", "value", "sd", "unit"], rows),
        "",
        *(
            ["K1 is the relative error of the sensitivity at 1 g; K3 is that of A plus that of B"]
            * cubic
        ),
        f"{count} positions, condition number {fit.condition:.2f}, residual of Z {rms:.2g} g^2 rms",
        *_stated(fit),
        f"from position {settled} on the sd of both {kind} stays within twice its last value",
    ]
    if fit.doubtful:
        lines += ["", fit.doubtful]
    return "\n".join(lines)


def _stated(fit: PairFit) -> list[str]:
    if fit.noise_ratio is None:
        return []
    text = f"the residuals are {fit.noise_ratio:.3g} times what the stated sd of A and B explain"
    dof = len(fit.residual_g2) - len(fit.values)
    follow = believed(fit.noise_ratio, dof) > 1.0
    return [f"{text}: too much for chance, the sd above follow the residuals" if follow else text]


def live_text(estimate: PairEstimate, mounting: str, target: float | None) -> str:
    """One line after a position: both cross-couplings with sd, and whether it is enough."""
    names = names_of(mounting)[KIP]
    if estimate.values is None:
        left = max(estimate.unknowns - estimate.count, 1)
        return f"{estimate.count}: at least {left} more for an estimate"
    values, sd = estimate.values[KIP], None if estimate.sd is None else estimate.sd[KIP]
    parts = [
        f"{name} {values[k] * 1e6:.3f}" + ("" if sd is None else f" (sd {sd[k] * 1e6:.2g})")
        for k, name in enumerate(names)
    ]
    text = f"{estimate.count}: {', '.join(parts)} e-6 g/g^2"
    if estimate.surprise > SURPRISE:
        text += f"; this position is {estimate.surprise:.0f} sd from the others: measure it again"
    return f"{text}; {_progress(estimate, target)}"


def _progress(estimate: PairEstimate, target: float | None) -> str:
    if estimate.enough(target):
        return "ENOUGH"
    if estimate.sd is None or estimate.dof < DOF_MIN:
        return f"{DOF_MIN - estimate.dof} more to know the noise"
    if target is not None:
        return f"target {target * 1e6:g}e-6 not yet reached"
    return f"the angles are not yet spread over the turn ({estimate.spread:.1f} times its sd)"


def _coefficient(value: float, sd: float, unit: str) -> list[str]:
    if unit == "rad":
        return [f"{value * _ARCSEC_PER_RAD:.4g}", f"{sd * _ARCSEC_PER_RAD:.2g}", "arcsec"]
    return [f"{value:.4e}", f"{sd:.1e}", unit or "-"]


def pair_picture(recursion: Recursion, mounting: str) -> bytes:
    """Estimates of both cross-couplings after each position, with their sd on either side.

    From twice as many positions as unknowns: before, they are off any scale that shows the end.
    """
    unknowns = recursion.values.shape[1]
    first = min(unknowns, len(recursion.values) - 2)
    x = np.arange(first, len(recursion.values), dtype=np.float64) + unknowns
    panels = []
    names = names_of(mounting)
    for k in (4, 5, 6):
        scale, unit = (_ARCSEC_PER_RAD, "arcsec") if k == 6 else (1e6, "1e-6 g/g^2")
        values, sd = recursion.values[first:, k] * scale, recursion.sd[first:, k] * scale
        last, room = float(values[-1]), 12.0 * float(sd[-1]) or 1.0
        lines = [
            Line("estimate", COLOURS[0], x, values),
            Line("estimate ± sd", COLOURS[1], x, values + sd, dashed=True),
            Line("estimate ± sd", COLOURS[1], x, values - sd, dashed=True),
        ]
        title = f"{names[k]}, {unit}"
        panels.append(Panel(title, "position", lines, (), (last - room, last + room)))
    return line_plot("Cross-coupling, position after position", panels)
