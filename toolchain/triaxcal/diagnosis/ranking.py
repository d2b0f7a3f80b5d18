"""All causes against the readings of one unit: screened, then the best judged with care."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from triaxcal.diagnosis.causes.registry import CAUSES
from triaxcal.diagnosis.core.cause import DwellCause, Known
from triaxcal.diagnosis.core.curves import standing_force
from triaxcal.diagnosis.core.evidence import Judged, climb, judge, linked, sensible
from triaxcal.diagnosis.core.pair import Pair
from triaxcal.diagnosis.core.readings import Readings
from triaxcal.diagnosis.core.scales import Scales
from triaxcal.diagnosis.core.screen import Screen, Screened
from triaxcal.diagnosis.core.sound import Fit, System
from triaxcal.model.types import FloatArray

_CAREFUL = 7
"""Causes that are judged with care."""
_FEWEST = 3
"""Causes that are judged with care, however far behind they are."""
_FAR = 80.0
"""Log evidence behind the best beyond which a cause is not judged with care."""
_HOPELESS = -9.5
"""Quick log evidence against a sound unit below which a cause is not judged with care."""
_ODD = 8
"""Dwells of which one may be wrong: the others stand out less."""
_SEVERAL = 6
"""Dwells that may be wrong at once."""
_USUAL = {
    "noise": 1.4,
    "tilt": 40e-6,
    "seat": 100e-6,
    "bias_curvature": 3.0,
    "curvature": 3.0,
    "bend": 50e-6,
}
"""Scales that a sound unit mostly has at the most."""
_SCATTER = 2.0
"""Of a sum of squares, in its standard deviations."""
_FIRSTS = 4
"""Causes that are tried with a second one, where the best does not explain everything."""
_SECONDS = 3
"""Second causes that are judged with care."""
_UNLIKELY = -6.0
"""Quick log evidence of a second cause, below which the first one explains everything."""
_LOOSE = ("unknown", "dwells")
"""Causes that explain whatever remains."""
TOGETHER = "together"
"""The cause that stands for two at once."""
Nominal = tuple[FloatArray | None, float]
"""Nominal sensitivities in V/g, shape (3,), and their relative tolerance."""
_FEW_PLACES = 3
"""Places that are all judged: of large mistakes the quick evidence may take the wrong one."""
_BEHIND = 10.0
"""Log evidence by which a second place may be behind the first, to be judged with care."""


@dataclass(frozen=True)
class Sound:
    """The readings as those of a sound unit, with the force in check positions that it sees."""

    readings: Readings
    system: System
    fit: Fit
    scales: Scales


@dataclass(frozen=True)
class Ranked:
    """A cause with the places where it was judged, the best first."""

    cause: DwellCause
    places: tuple[Judged, ...]

    @property
    def best(self) -> Judged:
        """At its most probable place."""
        return self.places[0]


def rank(readings: Readings, nominal: Nominal = (None, 0.1)) -> tuple[Sound, list[Ranked]]:
    """Causes by falling evidence, and the sound unit they stand against."""
    sound = _sound(readings)
    found = _alone(sound, nominal)
    return sound, sorted(
        [*found, *_together(found, sound, nominal)], key=lambda r: -r.best.log_evidence
    )


def _alone(sound: Sound, nominal: Nominal) -> list[Ranked]:
    """One cause, by falling evidence."""
    readings = sound.readings
    # What the sound unit takes for noise, tilts and curvature may be the mistake.
    curved = _curved(sound.scales)
    screen = Screen(sound.system, (sound.scales, Scales(), curved))
    known = Known(
        readings, sound.fit.theta, screen.odd_dwells(_ODD), screen.standing_out(_SEVERAL), *nominal
    )
    screened = _screened(known, screen)
    best = screened[0][1][0].log_evidence
    least = max(sound.fit.log_evidence + _HOPELESS, best - _FAR)
    near = [item for item in screened[:_CAREFUL] if item[1][0].log_evidence > least]
    near += screened[len(near) : max(_FEWEST, len(near))]
    found = [_careful(c, s, readings, screen.theta) for c, s in near]
    found.sort(key=lambda r: -r.best.log_evidence)
    return found


def _together(found: list[Ranked], sound: Sound, nominal: Nominal) -> list[Ranked]:
    """Two causes, where the best one leaves something that a second one explains.

    The best cause may be the wrong one of two: then the next ones are tried with a second as well.
    """
    readings, best = sound.readings, found[0]
    if best.best.log_evidence < sound.fit.log_evidence or _explains_everything(best.best):
        return []
    pairs: dict[str, Judged] = {}
    alone: list[Ranked] = []
    for ranked in found[:_FIRSTS]:
        if ranked.cause.name in _LOOSE:
            continue
        first = ranked.best
        if not sensible(first.fit.theta, first.system.readings):
            continue
        # The force in check positions as the unit shows it without the first cause.
        force = standing_force(first.system.readings, first.fit.theta).force
        seen = readings.but(force=np.where(readings.test[:, None], readings.force, force))
        for pair in _pairs(ranked, seen, nominal):
            judged = judge(pair.hypothesis(), seen, first.scales, first.fit.theta)
            if pair.superfluous(judged):
                # The second explains alone what the first, at another place, was taken for.
                second = judge(pair.second, readings, judged.scales, judged.fit.theta)
                alone.append(Ranked(pair.causes[1], (second,)))
            before = pairs.setdefault(pair.key, judged)
            if judged.log_evidence > before.log_evidence:
                pairs[pair.key] = judged
        if all(j.log_evidence < best.best.log_evidence for j in pairs.values()):
            return []
    places = sorted(pairs.values(), key=lambda j: -j.log_evidence)
    return [*alone, Ranked(CAUSES[TOGETHER], tuple(places))] if places else alone


def _explains_everything(judged: Judged) -> bool:
    """Whether what is left is no more than of most sound units: no second cause need be sought."""
    rows = float(judged.system.used.sum())
    usual = all(
        getattr(judged.scales, name) <= value * (1.0 + 1e-9) for name, value in _USUAL.items()
    )
    return usual and judged.fit.squares < rows + _SCATTER * np.sqrt(2.0 * rows)


def _pairs(ranked: Ranked, readings: Readings, nominal: Nominal) -> list[Pair]:
    """A cause and the most probable seconds of what remains without it."""
    first = ranked.best
    mended = first.hypothesis.undo(readings, first.amplitudes)
    system = System(mended, first.system.linear_about, first.system.unused)
    curved = _curved(first.scales)
    screen = Screen(system, (first.scales, Scales(), curved), first.added)
    known = Known(
        mended, first.fit.theta, screen.odd_dwells(_ODD), screen.standing_out(_SEVERAL), *nominal
    )
    least = first.fit.log_evidence + _UNLIKELY
    pairs = [
        (Pair((ranked.cause, cause), first, s[0].hypothesis), _by_readings(s[0]))
        for cause, s in _screened(known, screen)
    ]
    pairs = [item for item in pairs if item[0].possible and item[1] > least]
    pairs.sort(key=lambda item: -item[1])
    return [pair for pair, _ in pairs[:_SECONDS]]


def _by_readings(second: Screened) -> float:
    """Log evidence without what makes a place more probable beforehand: it is the first's too."""
    return second.log_evidence - max(second.hypothesis.log_prior, 0.0)


def _curved(found: Scales) -> Scales:
    """Usual scales, but with curves that bend much."""
    return replace(
        Scales(),
        bias_curvature=max(found.bias_curvature, 3.0),
        curvature=max(found.curvature, 3.0),
    )


def _sound(readings: Readings) -> Sound:
    start = Scales()
    fit, scales = climb(linked(readings, start), start)
    system = linked(standing_force(readings, fit.theta), scales)
    fit, scales = climb(system, scales)
    return Sound(standing_force(readings, fit.theta), system, fit, scales)


def _screened(known: Known, screen: Screen) -> list[tuple[DwellCause, list[Screened]]]:
    """Causes with their places, the most probable ones first."""
    scored = [
        (
            cause,
            sorted(
                (screen.score(h) for h in cause.hypotheses(known)), key=lambda s: -s.log_evidence
            ),
        )
        for cause in CAUSES
    ]
    return sorted((item for item in scored if item[1]), key=lambda item: -item[1][0].log_evidence)


def _careful(
    cause: DwellCause, screened: list[Screened], readings: Readings, theta: FloatArray
) -> Ranked:
    best = screened[0].log_evidence
    # Those with the same words are the same place with another strength.
    distinct = {s.hypothesis.place: s for s in reversed(screened)}
    places = [s for s in screened if distinct[s.hypothesis.place] is s]
    near = [s for s in places[:2] if s.log_evidence > best - _BEHIND]
    near = places if len(places) <= _FEW_PLACES else near
    judged = [judge(s.hypothesis, readings, s.scales, theta) for s in near]
    return Ranked(cause, tuple(sorted(judged, key=lambda j: -j.log_evidence)))
