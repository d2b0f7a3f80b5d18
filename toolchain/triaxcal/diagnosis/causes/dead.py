"""An output does not answer to the force."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.blocks import at_temperatures, in_blocks, sets_of
from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, explained, unchanged
from triaxcal.diagnosis.core.curves import powers
from triaxcal.diagnosis.core.readings import Readings
from triaxcal.model.positions import AXES
from triaxcal.model.types import BoolArray

_ANSWER = 0.05
"""Of the force: an output that changes by less does not answer."""
_BIAS_SD = np.array([0.5, 0.03, 5e-3, 2e-3, 1e-3])


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    readings = known.readings
    blocks = list(readings.test_blocks)
    for i in range(3):
        silent = tuple(b for b in blocks if _is_silent(readings, in_blocks(readings, (b,)), i))
        if _is_silent(readings, readings.test, i):
            yield _silent(readings, readings.test, i, f"output {AXES[i]}", 3.0)
        elif silent and len(silent) < len(blocks):
            where = f"output {AXES[i]} {at_temperatures(readings, silent)}"
            yield _silent(
                readings, in_blocks(readings, silent), i, where, 3.0 * sets_of(len(blocks))
            )


def _is_silent(readings: Readings, own: BoolArray, i: int) -> bool:
    return bool(np.ptp(readings.outputs[own, i]) <= 2 * _ANSWER)


def _silent(readings: Readings, dwells: BoolArray, i: int, where: str, places: float) -> Hypothesis:
    own = readings.outputs[dwells, i]
    basis = powers(readings.temps_degc[dwells], readings.t0_degc) * _BIAS_SD
    covariance = basis @ basis.T + np.diag(np.maximum(2 * readings.sd[dwells, i], 5e-6) ** 2)
    _, log_det = np.linalg.slogdet(2 * np.pi * covariance)
    density = -0.5 * (log_det + own @ np.linalg.solve(covariance, own))
    unused = np.zeros((len(readings), 3), dtype=np.bool_)
    unused[dwells, i] = True
    return Hypothesis(
        where,
        unchanged,
        rows=readings.rows[dwells] if places > 3.0 else readings.rows,
        change=f"without {where}",
        places=places,
        unused=unused,
        log_density=explained(float(density), len(own)),
    )


ENTRY = Cause(
    name="dead",
    label="an output that does not answer",
    doc="An output stays the same in every position.",
    hypotheses=_hypotheses,
    apart="the unit turned by hand while the output is watched",
    discrete=True,
    spoils=True,
    rank=33,
)
