"""`diagnose`: which cause explains contradictory readings, and what else it may be."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.screentext import table
from triaxcal.diagnosis.core.cause import name_of
from triaxcal.diagnosis.core.curves import standing_force
from triaxcal.diagnosis.core.evidence import Judged
from triaxcal.diagnosis.core.readings import Readings, readings_of
from triaxcal.diagnosis.nextdwell import Request, next_dwell
from triaxcal.diagnosis.ranking import TOGETHER, Ranked, rank
from triaxcal.diagnosis.remaining import Remaining
from triaxcal.fitting.recorded.wrong import MARGIN
from triaxcal.model.positions import TEST_POSITIONS
from triaxcal.readings.measurements import MeasurementSet
from triaxcal.unit.description import UnitDescription

_EQUIVALENT = 0.5
"""Difference of log likelihood below which readings cannot tell two causes at all."""
_PLACES = 8.0
"""Log evidence that numbers of places can differ by."""
_ALIKE = 12.0
"""Log evidence that causes which explain the same readings can differ by, having other priors."""
_FAR_BEHIND = 12.0
"""Log evidence behind the best, beyond which no dwell is asked for to tell a second cause."""
UNKNOWN = "unknown"
"""The cause that stands for what is not in the list."""
_FEW = 3
_MOST_ODDS = 1e6
_SHOWN = 6
"""Amplitudes that are shown of a cause; more are those of a curve."""


class Left(Protocol):
    """What is left of a contradiction when a mistake is undone; `str` is a sentence."""

    @property
    def held_out(self) -> str:
        """For a table; "-" where nothing is."""

    @property
    def checks(self) -> str:
        """The same in check positions."""


class Explained(Protocol):
    """How well a cause explains the readings, with and without its prior odds."""

    @property
    def log_evidence(self) -> float:
        """With prior odds."""

    @property
    def log_likelihood(self) -> float:
        """Without."""


@dataclass(frozen=True)
class Amplitude:
    """How large a mistake is.

    Attributes
    ----------
    name, unit : str
    value, sd : float
        In `unit`.
    moves_g : float
        How far it moves outputs, g.
    """

    name: str
    unit: str
    value: float
    sd: float
    moves_g: float

    def __str__(self) -> str:
        return f"{self.name} {self.value:+.3g} +- {self.sd:.2g} {self.unit}"


@dataclass(frozen=True)
class Suspect:
    """A cause at its most probable place.

    Attributes
    ----------
    cause, label : str
        Name in the registry, and for people.
    place : str
        "TP3 at 20 degC (row 9)"; "" where there is only one.
    rows : tuple of int
        Lines of the file that it is about.
    log_evidence : float
        Natural logarithm of its odds against a sound unit, prior odds included.
    change : str
        What undoing it changes.
    amplitudes : tuple of Amplitude
    remaining : Remaining, or `poses.answer.HeldOut`
        Held-out errors with the mistake undone.
    apart : str
        The datum that would tell it from causes that look the same.
    name : str
        Label and place.
    spoils, symptom : bool
        Whether constants of readings with it are wrong; whether it is but how they look.
    alike : tuple of str
        Causes that explain the same readings, where there are no check dwells.
    """

    cause: str
    label: str
    place: str
    rows: tuple[int, ...]
    log_evidence: float
    change: str
    amplitudes: tuple[Amplitude, ...]
    remaining: Left
    apart: str
    name: str
    spoils: bool
    symptom: bool
    alike: tuple[str, ...]
    judged: Explained = field(repr=False, compare=False)

    @property
    def size(self) -> str:
        """Its amplitudes in words, where there are few; "" of a cause without or with many."""
        if not 0 < len(self.amplitudes) <= _FEW:
            return ""
        return f" ({', '.join(str(a) for a in self.amplitudes)})"


@dataclass(frozen=True, repr=False)
class Diagnosis:
    """Causes of one unit's readings, ranked.

    Attributes
    ----------
    suspects : tuple of Suspect
        The best place of each cause that was judged with care, and others as good.
    answer : tuple of Suspect
        Those that the readings do not tell from the best; empty where a sound unit is more probable
        than any cause.
        A sound unit is a part of it where the best is within `MARGIN` of it.
    sound : Remaining, or `poses.answer.HeldOut`
        Held-out errors of the readings as they are.
    request : Request or None
        The further dwell that would separate the two best.
    """

    suspects: tuple[Suspect, ...]
    answer: tuple[Suspect, ...]
    sound: Left
    request: Request | None

    @property
    def clear(self) -> bool:
        """Whether the readings tell a cause from a sound unit: odds of 20 to 1 and more."""
        return bool(self.answer and self.answer[0].log_evidence > MARGIN)

    @property
    def sentence(self) -> str:
        """The answer in one line: the best cause, what it would change, and what else it may be."""
        if not self.answer:
            return "no cause is more probable than a sound unit"
        best = self.answer[0]
        text = f"{'most probably' if self.clear else 'perhaps'} {self._best_in_words}"
        others = [s.name for s in self.answer[1:]]
        if not self.clear:
            others.append("a sound unit")
        if others:
            text += f"; the readings cannot tell it from {' or '.join(others)}"
            data = dict.fromkeys(s.apart for s in (best, *self.answer[1:]))
            text += f"; to distinguish them: {'; or '.join(data)}"
        return text

    @property
    def _best_in_words(self) -> str:
        """The best cause, and what it leaves where that is not what there was before."""
        best = self.answer[0]
        if best.cause == UNKNOWN:
            where = f", {best.place}" if best.place else ""
            return f"something that is not in the list of causes{where}"
        text = f"{best.name}{best.size}: {best.change}"
        left = str(best.remaining)
        return text if left in {"", str(self.sound)} else f"{text}, {left}"

    def __str__(self) -> str:
        rows = [(s.log_evidence, s.remaining, s.name) for s in self.suspects]
        if not self.answer:
            rows = [row for row in rows if row[0] > -MARGIN]
        rows.append((0.0, self.sound, "none: a sound unit"))
        rows.sort(key=lambda r: -r[0])
        head: tuple[str, ...] = (
            "ln odds",
            "held out",
            "in checks",
            "cause, undone for the errors held out",
        )
        # Columns as wide as their heads, which are not broken then.
        cells: list[tuple[str, ...]] = [
            (_odds_in_words(odds), f"{left.held_out:>8}", f"{left.checks:>9}", name)
            for odds, left, name in rows
        ]
        if all(left.checks == "-" for _, left, _ in rows):
            head, cells = _without_checks(head), [_without_checks(row) for row in cells]
        lines = [self.sentence]
        if self.answer and not self.answer[0].size:
            lines += [f"  {a}" for a in self.answer[0].amplitudes[:_SHOWN]]
        if self.request is not None:
            lines.append(self.request.between(self.suspects[0].name, self.suspects[1].name))
        return "\n".join([*lines, "", *table(head, cells, left=(len(head) - 1,))])

    __repr__ = __str__


def _odds_in_words(odds: float) -> str:
    """Ln odds for a table, as far as they mean anything."""
    if abs(odds) > _MOST_ODDS:
        return f"above {_MOST_ODDS:.0e}" if odds > 0.0 else f"below -{_MOST_ODDS:.0e}"
    return f"{odds:.1f}"


def diagnose(unit: UnitDescription, measurements: MeasurementSet) -> Diagnosis:
    """Rank the causes that could explain the readings of a unit on a tilter.

    Every cause is a small model with its own parameters; they compete by their evidence, in which
    each pays for its parameters and for the number of its places.

    Raises
    ------
    RefusedError
        When a test position is missing altogether.
    """
    missing = [p for p in TEST_POSITIONS if p not in {d.position for d in measurements.dwells}]
    if missing:
        raise RefusedError(
            measurements.source,
            f"no dwell in {', '.join(missing)}",
            expected="TP1 to TP6",
            remedy="measure what is missing",
        )
    readings = readings_of(unit, measurements)
    nominal = None if unit.nominal_v_per_g is None else np.array(unit.nominal_v_per_g)
    sound, ranked = rank(readings, (nominal, unit.nominal_tolerance))
    readings = sound.readings
    base = sound.fit.log_evidence
    judged = {_suspect(r, j, readings, base): j for r in ranked for j in r.places}
    found = answered(judged, Remaining(readings), checks=not readings.test.all())
    shown = found.suspects
    near = len(shown) > 1 and shown[1].log_evidence > shown[0].log_evidence - _FAR_BEHIND
    if not (found.answer and near):
        return found
    return replace(found, request=next_dwell(readings, judged[shown[0]], judged[shown[1]]))


def answered(suspects: Iterable[Suspect], sound: Left, *, checks: bool = True) -> Diagnosis:
    """What is said of causes at their places, in any order; without `checks` some look alike."""
    # Two causes go first only where they are clearly more probable than one.
    of_name: dict[str, Suspect] = {}
    for suspect in sorted(
        suspects, key=lambda s: (MARGIN if s.cause == TOGETHER else 0.0) - s.log_evidence
    ):
        of_name.setdefault(suspect.name, suspect)  # places without a name of their own are one
    ranked = list(of_name.values())
    best = ranked[0]
    answer = [
        s
        for s in ranked
        if s.log_evidence > best.log_evidence - MARGIN
        or _equivalent(s.judged, best.judged)
        or (not checks and s.cause in best.alike and s.log_evidence > best.log_evidence - _ALIKE)
    ]
    if best.log_evidence <= 0.0:
        answer = []
    return Diagnosis(_shown(ranked), tuple(answer), sound, None)


def _equivalent(one: Explained, other: Explained) -> bool:
    """Whether only the number of places and the like differ between two."""
    near = abs(one.log_evidence - other.log_evidence) < _PLACES
    return near and abs(one.log_likelihood - other.log_likelihood) < _EQUIVALENT


def _without_checks(cells: tuple[str, ...]) -> tuple[str, ...]:
    return (*cells[:2], *cells[3:])


def _shown(suspects: list[Suspect]) -> tuple[Suspect, ...]:
    """The best place of each cause, and further places that are nearly as good."""
    best: dict[str, float] = {}
    shown = []
    for s in suspects:
        first = best.setdefault(s.cause, s.log_evidence)
        if s.log_evidence > first - MARGIN:
            shown.append(s)
    return tuple(shown)


def _suspect(ranked: Ranked, judged: Judged, readings: Readings, base: float) -> Suspect:
    hypothesis = judged.hypothesis
    amplitudes = tuple(
        Amplitude(p.name, p.unit, float(v) * p.per_unit, float(sd) * p.per_unit, abs(v) * p.moves_g)
        for p, v, sd in zip(hypothesis.parameters, judged.amplitudes, judged.sd, strict=True)
    )
    # Constants of the unit without the mistake say best what it shows in a check position.
    readings = standing_force(readings, judged.fit.theta)
    mended = hypothesis.undo(readings, judged.amplitudes)
    return Suspect(
        ranked.cause.name,
        ranked.cause.label,
        hypothesis.place,
        tuple(int(r) for r in hypothesis.rows),
        judged.log_evidence - base,
        hypothesis.change,
        amplitudes,
        Remaining(mended),
        ranked.cause.apart,
        name_of(ranked.cause, hypothesis),
        ranked.cause.spoils or hypothesis.spoils,
        ranked.cause.symptom,
        ranked.cause.alike,
        judged,
    )
