"""How many units of a series have which verdict."""

from __future__ import annotations

from collections import Counter

from triaxcal.batch.run import Series
from triaxcal.delivery.verdict import PASSED, REFUSED


def results(series: Series) -> list[tuple[str, int]]:
    """Verdicts with the number of their units: those that have passed first, refused ones last."""
    found = Counter({PASSED: 0})
    found.update(r["result"] for r in series.records)
    return [*found.items(), (REFUSED, len(series.refused))]
