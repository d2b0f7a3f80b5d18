"""A check of a delivered calibration, for the terminal."""

from __future__ import annotations

from pathlib import PurePath

import numpy as np

from triaxcal.base.screentext import table
from triaxcal.model.positions import AXES
from triaxcal.uncertainty.check import FieldCheck

_ROWS = 40
"""Poses of a longer check are cut to the worst ones."""


def check_text(serial: str, found: FieldCheck) -> str:
    """Poses, chi-square, limits, and why it failed."""
    lines = [f"{serial} against {_name(found.poses.source)}: {_poses(len(found.poses))}", ""]
    lines += _table(found)
    e, count = found.expected, len(found.poses)
    lines += [
        "",
        f"chi-square   {e.chi_square:.1f}, {count} expected; {_chance(found.chance)}",
        f"largest      {_worst(found)}",
    ]
    if found.consistent:
        lines += [f"would show   a change of the bias, in 95 of 100 checks: {_seen(found)}"]
    lines += [f"found        {words}" for words in (*found.poses.findings, *found.flagged)]
    lines += ["", *verdict_lines(found)]
    return "\n".join(lines)


def verdict_lines(found: FieldCheck) -> list[str]:
    """Passed or failed, with the reasons."""
    undecided = int(found.undecided.sum())
    noisy = f"{undecided} of {_poses(len(found.poses))} beyond the limit by less than their noise"
    if found.passed:
        limits = "no pose is surely beyond its limit" if undecided else "every pose is in limits"
        lines = [f"passed       the constants agree with this recording, and {limits}"]
        noisy += ": hold the unit stiller and longer"
        return lines + [f"not tested   {noisy}"] * bool(undecided)
    reasons = []
    if not found.consistent:
        reasons.append("the constants contradict this recording beyond the uncertainty")
    if not found.within_limits:
        beyond = int(found.beyond.sum())
        reasons.append(f"{beyond} of {_poses(len(found.poses))} beyond the limit")
    lines = ["FAILED       " + "; ".join(reasons)]
    alike = found.explanations
    if alike:
        lines.append(f"explained    if {alike[0].words}")
        lines += [f"or           if {other.words}" for other in alike[1:]]
        if len(alike) > 1:
            lines.append("             these poses cannot tell which")
    lines += [f"suspected    {words}" for words in found.suspicions]
    return lines


def _table(found: FieldCheck) -> list[str]:
    e = found.expected
    order = range(len(found.poses))
    shown = list(order)
    if len(shown) > _ROWS:
        ratio = found.largest_g / found.limit_g
        shown = sorted(np.argsort(-ratio, kind="stable")[:_ROWS].tolist())
    rows = [
        [
            f"  {found.poses.names[k]}",
            f"{found.poses.temps_degc[k]:.1f}",
            f"{e.error_g[k] * 1e3:+.3f}",
            "-" if found.c_error_g is None else f"{found.c_error_g[k] * 1e3:+.3f}",
            f"{2.0 * e.sd_g[k] * 1e3:.3f}",
            f"{found.limit_g[k] * 1e3:g}",
            "beyond" if found.beyond[k] else "noise" if found.undecided[k] else "",
        ]
        for k in shown
    ]
    head = ["|a| - g, mg", "degC", "model", "C", "expected +-", "limit", ""]
    lines = table(head, rows)
    if len(shown) < len(found.poses):
        lines.append(f"  the {len(shown)} poses nearest to their limits, of {len(found.poses)}")
    return lines


def _poses(count: int) -> str:
    return f"{count} pose{'s' * (count != 1)}"


def _worst(found: FieldCheck) -> str:
    k = found.worst
    return (
        f"{found.largest_g[k] * 1e3:.3f} mg in {found.poses.names[k]}, limit "
        f"{found.limit_g[k] * 1e3:g} mg"
    )


def _seen(found: FieldCheck) -> str:
    seen = dict(zip(AXES, found.seen_bias_g.tolist(), strict=True))
    parts = [f"{axis} {v * 1e3:.2g} mg" for axis, v in seen.items() if np.isfinite(v)]
    unseen = [axis for axis, v in seen.items() if not np.isfinite(v)]
    if unseen:
        parts.append(f"none of {', '.join(unseen)}, along which no pose points")
    return ", ".join(parts)


def _chance(chance: float) -> str:
    if chance >= 0.2:
        return "as of a sound unit"
    words = f"{chance:.1g}" if chance >= 1e-6 else "below 1e-6"
    return f"chance {words} for a sound unit"


def _name(source: str) -> str:
    return PurePath(source.replace("\\", "/")).name
