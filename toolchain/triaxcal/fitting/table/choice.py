"""Which candidate of poses with known angles is taken, and why."""

from __future__ import annotations

import math
from collections.abc import Sequence

from triaxcal.fitting.recorded.trials import beats
from triaxcal.fitting.table.candidates import TableRow
from triaxcal.fitting.table.full import NOISE_MIN_G


def choose_table(rows: Sequence[TableRow], temperatures: list[list[int]]) -> tuple[TableRow, str]:
    """Linear or all terms: what predicts the held-out poses better.

    Of the linear candidates the simplest that no other beats; so of those with priors. Quadratic
    terms without a prior are taken only where they beat the latter: a sensor beyond its prior. A
    row without a score is no better than any.
    """
    linear = [r for r in rows if not r.trial.quadratic]
    bounded = [r for r in rows if r.trial.priors is not None]
    free = [r for r in rows if r.trial.quadratic and r.trial.priors is None]
    finalists = [_simplest(part) for part in (linear, bounded or free) if part]
    # Below the floor of the noise no difference matters.
    best = min(finalists, key=lambda r: (max(_score(r), NOISE_MIN_G), r.trial.parameters))
    best = next((r for r in free if r not in finalists and beats(r.errors_g, best.errors_g)), best)
    inner = len(temperatures) - 2 if len(temperatures) >= 4 else 0
    also = f" and {inner} temperatures" if inner else ""
    return best, (
        f"{best.trial.label}: held-out error {_micro_g(best)} a component, "
        f"each pose{also} held out in turn; {_against(best, finalists)}"
    )


def _simplest(rows: Sequence[TableRow]) -> TableRow:
    unbeaten = [r for r in rows if not any(beats(o.errors_g, r.errors_g) for o in rows)]
    return min(unbeaten, key=lambda r: r.trial.parameters)


def _score(row: TableRow) -> float:
    return math.inf if row.held_out_g is None else row.held_out_g


def _micro_g(row: TableRow) -> str:
    return f"{_score(row) * 1e6:.3g} micro-g"


def _against(best: TableRow, finalists: Sequence[TableRow]) -> str:
    """The rival with or without quadratic terms, in words."""
    rivals = [r for r in finalists if r is not best]
    if not rivals:
        return "the simplest that no other beats significantly"
    return f"the best of the other terms, {rivals[0].trial.label}, has {_micro_g(rivals[0])}"
