"""The run: units made somewhere, their files put in place, the journal kept."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from triaxcal.base.errors import RefusedError
from triaxcal.base.publish import publish
from triaxcal.batch import journal
from triaxcal.batch.order import Make, Outcome, Runner
from triaxcal.batch.plan import Work


@dataclass
class Series:
    """What a run has so far.

    Attributes
    ----------
    entries : dict
        Journal entries of the units that passed, by name; those made before are among them.
    refused : dict
        Why each of the others was refused, by name.
    made : int
        Units made in this run, refused ones included.
    skipped : dict
        Why units that were named are no units of a series, by name.
    """

    entries: dict[str, dict[str, Any]] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)
    made: int = 0
    skipped: dict[str, str] = field(default_factory=dict)

    @property
    def records(self) -> list[dict[str, Any]]:
        """Records of the units that passed, by name."""
        return [self.entries[name]["record"] for name in sorted(self.entries)]


def run_series(
    work: Work,
    build: Path,
    make: Make,
    runner: Runner,
    *,
    sometimes: Collection[str],
    report: Callable[[Outcome], None],
) -> Series:
    """Make what is to be made; `report` is called for each unit when its files are in place.

    Raises
    ------
    RefusedError
        When the journal cannot be written or the cluster is lost; what was made is kept.
    """
    skipped = {path.absolute().name: why for path, why in work.skipped if path.is_dir()}
    refusals = {o.name: o.refusal for o in work.refused}
    series = Series(dict(work.done), refusals, skipped=skipped)
    for outcome in work.refused:
        report(outcome)
    for outcome in runner(make, work.orders) if work.orders else ():
        placed = _placed(outcome, build, sometimes)
        series.made += 1
        if placed.refusal:
            series.refused[placed.name] = placed.refusal
        else:
            entry = journal.entry_of(placed)
            journal.append(build, entry)
            series.entries[placed.name] = entry
        report(placed)
    return series


def _placed(outcome: Outcome, build: Path, sometimes: Collection[str]) -> Outcome:
    if outcome.refusal:
        return outcome
    try:
        publish(outcome.files, build / outcome.name, sometimes)
    except RefusedError as refusal:
        return Outcome(outcome.name, outcome.key, str(refusal))
    return outcome
