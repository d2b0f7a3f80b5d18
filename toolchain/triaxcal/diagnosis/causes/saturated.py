"""Outputs saturate inside the range of +-1 g."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from math import comb

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, explained, unchanged
from triaxcal.diagnosis.core.readings import Readings
from triaxcal.model.positions import AXES
from triaxcal.model.types import BoolArray

_LEAST_G = 0.1
"""An end below it is that of an output that does not answer."""
_TO_END_G = 2.0
"""Where the level can lie."""


@dataclass(frozen=True)
class _End:
    """An output that stays at one level in some dwells.

    Attributes
    ----------
    output : int
    level_g : float
    dwells : array of bool, shape (n,)
    log_density : float
        Of the readings there, ln g^-n.
    """

    output: int
    level_g: float
    dwells: BoolArray
    log_density: float


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    readings = known.readings
    ends = [e for i in range(3) for sign in (1.0, -1.0) if (e := _end(readings, i, sign))]
    ends.sort(key=lambda e: -int(e.dwells.sum()))
    sets = [[e] for e in ends] + [ends[:k] for k in range(2, len(ends) + 1)]
    for some in sets:
        unused = np.zeros((len(readings), 3), dtype=np.bool_)
        for end in some:
            unused[end.dwells, end.output] = True
        ways = float(comb(6, len(some)))
        yield Hypothesis(
            ", ".join(f"output {AXES[e.output]} at {e.level_g:+.4g} g" for e in some),
            unchanged,
            rows=readings.rows[unused.any(axis=1)],
            change="without outputs where they are at their end"
            if len(some) > 1
            else f"without output {AXES[some[0].output]} where it is at its end",
            places=2.0 * ways,
            unused=unused,
            # With both ends lost nothing but the check dwells would tell a sensitivity.
            without_checks=any(n > 1 for n in Counter(e.output for e in some).values()),
            log_density=explained(sum(e.log_density for e in some), int(unused.sum())),
        )


def _end(readings: Readings, i: int, sign: float) -> _End | None:
    """Where an output is at its upper (+1) or lower (-1) end, if it looks so."""
    own = readings.test & (sign * readings.force[:, i] > 0.5)
    values = sign * readings.outputs[:, i]
    level = values[own].max() if own.any() else 0.0
    if level < _LEAST_G:
        return None
    near = np.maximum(6.0 * np.median(readings.sd[:, i]), 60e-6)
    clipped = own & (values > level - near)
    if clipped.sum() < 2:
        return None
    rest = values[clipped] - values[clipped].mean()
    sd = np.maximum(np.sqrt(np.mean(rest**2)), 3e-6)
    freedom = len(rest) - 1
    density = -0.5 * np.sum((rest / sd) ** 2) - freedom * np.log(sd * 2.5066)
    return _End(i, sign * level, np.asarray(clipped), float(density) - float(np.log(_TO_END_G)))


ENTRY = Cause(
    name="saturated",
    label="saturation inside the range",
    doc="An output stays at one level where the force goes on rising: its converter is at its end.",
    hypotheses=_hypotheses,
    apart="the codes of the converter near its end",
    discrete=True,
    rank=41,
    spoils=True,
)
