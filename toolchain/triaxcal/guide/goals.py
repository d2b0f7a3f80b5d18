"""What is demanded of the constants, and how near their standard deviations are to it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.limits import SD_DEMANDS, ImuLimits, places_of
from triaxcal.model.types import FloatArray


@dataclass(frozen=True)
class Goal:
    """One demand: none of some states has a larger standard deviation.

    Attributes
    ----------
    words : str
        What the states are.
    unit : str
        Of the demand.
    demand : float
        Largest standard deviation, in `unit`; inf where nothing is demanded.
    places : tuple of int
        States in the layout.
    """

    words: str
    unit: str
    demand: float
    places: tuple[int, ...]


@dataclass(frozen=True)
class Standing:
    """Where a goal stands.

    Attributes
    ----------
    goal : Goal
    sd : float
        Largest standard deviation of its states, in its unit.
    place : int
        The state that has it.
    prior_sd : float
        Of that state before the recording, in its unit.
    """

    goal: Goal
    sd: float
    place: int
    prior_sd: float

    @property
    def way(self) -> float:
        """Part of the way from the prior to the demand, in powers of ten; 1 where it is met."""
        if self.reached:
            return 1.0
        whole = math.log(max(self.prior_sd / self.goal.demand, 1.0 + 1e-9))
        return min(max(math.log(self.prior_sd / self.sd) / whole, 0.0), 1.0)

    @property
    def ratio(self) -> float:
        """Standard deviation over the demand."""
        return self.sd / self.goal.demand

    @property
    def reached(self) -> bool:
        """Whether the demand is met."""
        return self.sd <= self.goal.demand


def goals_of(limits: ImuLimits, layout: Layout) -> tuple[Goal, ...]:
    """What [limits] demands of the constants of a layout; inf where it demands nothing."""
    found = []
    for kind in SD_DEMANDS:
        demand, places = getattr(limits, kind.key), tuple(places_of(kind, layout))
        if places:
            most = math.inf if demand is None else demand
            found.append(Goal(kind.words, kind.unit, most, places))
    return tuple(found)


def standings(goals: Sequence[Goal], layout: Layout, sd: FloatArray) -> tuple[Standing, ...]:
    """Where goals stand; `sd` are standard deviations of the layout's states, SI."""
    shown = sd / layout.per_unit
    worst = [max(goal.places, key=lambda i: float(shown[i])) for goal in goals]
    prior = [state.prior_sd for state in layout.states]
    return tuple(
        Standing(g, float(shown[i]), i, prior[i]) for g, i in zip(goals, worst, strict=True)
    )
