"""The temperatures of two blocks are exchanged."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Undo
from triaxcal.diagnosis.core.readings import Readings, rows_in_words
from triaxcal.model.types import FloatArray


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    readings = known.readings
    kind = {b: bool(readings.test[readings.of_block(b)].all()) for b in readings.blocks}
    pairs = [(a, b) for a, b in combinations(readings.blocks, 2) if kind[a] == kind[b]]
    pairs = [p for p in pairs if abs(readings.block_degc(p[0]) - readings.block_degc(p[1])) > 3.0]
    for a, b in pairs:
        rows = [readings.rows[readings.of_block(k)] for k in (a, b)]
        degc = [f"{readings.block_degc(k):.4g}" for k in (a, b)]
        yield Hypothesis(
            f"{degc[0]} and {degc[1]} degC",
            _exchanged(a, b),
            rows=readings.rows[readings.of_block(a) | readings.of_block(b)],
            change=f"with {degc[1]} degC in {rows_in_words(rows[0])} and {degc[0]} degC in "
            f"{rows_in_words(rows[1])}",
            places=float(len(pairs)),
        )


def _exchanged(a: int, b: int) -> Undo:
    def undo(readings: Readings, _amplitudes: FloatArray) -> Readings:
        temps = readings.temps_degc.copy()
        difference = readings.block_degc(b) - readings.block_degc(a)
        temps[readings.of_block(a)] += difference
        temps[readings.of_block(b)] -= difference
        return readings.but(temps_degc=temps)

    return undo


ENTRY = Cause(
    name="exchanged_blocks",
    label="temperatures of two blocks exchanged",
    doc="Two blocks of readings stand under each other's temperatures.",
    hypotheses=_hypotheses,
    apart="the log of the chamber",
    discrete=True,
    rank=61,
    spoils=True,
)
