"""Outputs are inverted at some temperatures and not at the others."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from triaxcal.diagnosis.core.blocks import Blocks, Struck, in_blocks, struck_some
from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Undo
from triaxcal.diagnosis.core.readings import Readings
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray

_SETS = [c for n in (1, 2, 3) for c in combinations(range(3), n)]


def _signs(outputs: tuple[int, ...]) -> FloatArray:
    return np.where(np.isin(np.arange(3), outputs), -1.0, 1.0)


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    signs = np.array([_signs(s) for s in _SETS])

    def described(outputs: tuple[int, ...], blocks: Blocks, where: str) -> Struck:
        plural = "s" if len(outputs) > 1 else ""
        named = f"output{plural} {' and '.join(AXES[i] for i in outputs)}"
        return _inverted(outputs, blocks), f"{named} {where}", f"with {named} inverted {where}"

    # At all temperatures it is a polarity.
    return struck_some(known.readings, _SETS, lambda u: u * signs[:, None], described)


def _inverted(outputs: tuple[int, ...], blocks: Blocks) -> Undo:
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
