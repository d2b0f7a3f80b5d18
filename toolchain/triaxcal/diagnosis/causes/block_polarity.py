"""Outputs are inverted at some temperatures and not at the others."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from triaxcal.diagnosis.core.blocks import (
    apart,
    at_temperatures,
    in_blocks,
    sets_of,
    test_blocks,
    unlike,
)
from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Undo
from triaxcal.diagnosis.core.readings import Readings
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray

_SETS = [c for n in (1, 2, 3) for c in combinations(range(3), n)]


def _signs(outputs: tuple[int, ...]) -> FloatArray:
    return np.where(np.isin(np.arange(3), outputs), -1.0, 1.0)


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    readings = known.readings
    signs = np.array([_signs(s) for s in _SETS])
    count = len(test_blocks(readings))
    for outputs, blocks in unlike(readings, _SETS, lambda u: u * signs[:, None]):
        if len(blocks) == count:
            continue  # a polarity
        where = at_temperatures(readings, blocks)
        names = " and ".join(AXES[i] for i in outputs)
        plural = "s" if len(outputs) > 1 else ""
        yield Hypothesis(
            f"output{plural} {names} {where}",
            _inverted(outputs, blocks),
            rows=readings.rows[in_blocks(readings, blocks)],
            change=f"with output{plural} {names} inverted {where}",
            places=len(_SETS) * sets_of(count),
            log_prior=apart(readings, blocks),
        )


def _inverted(outputs: tuple[int, ...], blocks: tuple[int, ...]) -> Undo:
    signs = _signs(outputs)

    def undo(readings: Readings, _amplitudes: FloatArray) -> Readings:
        own = in_blocks(readings, blocks)[:, None]
        return readings.but(outputs=np.where(own, readings.outputs * signs, readings.outputs))

    return undo


ENTRY = Cause(
    name="block_polarity",
    label="outputs inverted at some temperatures",
    doc="Outputs are inverted in some blocks and not in the others: rewired, or logged otherwise.",
    hypotheses=_hypotheses,
    apart="wiring and columns at these temperatures",
    discrete=True,
    rank=53,
    spoils=True,
)
