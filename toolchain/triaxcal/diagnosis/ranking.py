"""All causes against the readings of one unit: screened, then the best judged with care."""

from __future__ import annotations

from dataclasses import dataclass, replace

from triaxcal.diagnosis.causes.registry import CAUSES
from triaxcal.diagnosis.core.cause import Cause, Known
from triaxcal.diagnosis.core.evidence import (
    Judged,
    Screen,
    Screened,
    climb,
    judge,
    linked,
    standing_force,
)
from triaxcal.diagnosis.core.readings import Readings
from triaxcal.diagnosis.core.sound import Fit, Scales, System
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

    cause: Cause
    places: tuple[Judged, ...]

    @property
    def best(self) -> Judged:
        """At its most probable place."""
        return self.places[0]


def rank(
    readings: Readings, nominal: tuple[FloatArray | None, float] = (None, 0.1)
) -> tuple[Sound, list[Ranked]]:
    """Causes by falling evidence, and the sound unit they stand against.

    `nominal` are the nominal sensitivities in V/g, shape (3,), and their relative tolerance.
    """
    sound = _sound(readings)
    readings = sound.readings
    # What the sound unit takes for noise, tilts and curvature may be the mistake.
    curved = replace(Scales(), curvature=max(sound.scales.curvature, 3.0))
    screen = Screen(sound.system, (sound.scales, Scales(), curved))
    known = Known(
        readings, sound.fit.theta, screen.odd_dwells(_ODD), screen.standing_out(_SEVERAL), *nominal
    )
    screened = [(cause, _screened(cause, known, screen)) for cause in CAUSES]
    screened = [item for item in screened if item[1]]
    screened.sort(key=lambda item: -item[1][0].log_evidence)
    best = screened[0][1][0].log_evidence
    least = max(sound.fit.log_evidence + _HOPELESS, best - _FAR)
    near = [item for item in screened[:_CAREFUL] if item[1][0].log_evidence > least]
    near += screened[len(near) : max(_FEWEST, len(near))]
    found = [_careful(c, s, readings, screen.theta) for c, s in near]
    found.sort(key=lambda r: -r.best.log_evidence)
    return sound, found


def _sound(readings: Readings) -> Sound:
    start = Scales()
    fit, scales = climb(linked(readings, start), start)
    system = linked(standing_force(readings, fit.theta), scales)
    fit, scales = climb(system, scales)
    return Sound(standing_force(readings, fit.theta), system, fit, scales)


def _screened(cause: Cause, known: Known, screen: Screen) -> list[Screened]:
    scored = [screen.score(h) for h in cause.hypotheses(known)]
    return sorted(scored, key=lambda s: -s.log_evidence)


def _careful(
    cause: Cause, screened: list[Screened], readings: Readings, theta: FloatArray
) -> Ranked:
    best = screened[0].log_evidence
    near = [s for s in screened[:2] if s.log_evidence > best - _BEHIND]
    judged = [judge(s.hypothesis, readings, s.scales, theta) for s in near]
    return Ranked(cause, tuple(sorted(judged, key=lambda j: -j.log_evidence)))
