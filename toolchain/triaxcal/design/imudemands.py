"""Demands of [limits] as the input of a plan: what a motion reaches, and how much of it is needed.

Information adds up over time, so that the variance of a constant falls about as one over the
duration. A search steps to the size at which the worst demand would then just be met, and looks
again, until it is met with little to spare or the programme is at its end.
"""

from __future__ import annotations

from dataclasses import dataclass

from triaxcal.base.errors import RefusedError
from triaxcal.base.progress import Progress
from triaxcal.design.imu import planned
from triaxcal.design.imuprogrammes import Programme, programmes_of
from triaxcal.dynamic.limits import demanded
from triaxcal.dynamic.shares import PRIOR, variance_shares
from triaxcal.dynamic.unit import DynamicUnit

ROUNDS = 5
SPARE = 0.9
"""A demand that is met to this part of it or closer is met with little to spare."""
SAME = 0.02
"""Sizes within this part of each other."""
MARGIN = 1.03
"""A step aims so much beyond what it needs."""
NAMED = 0.1
"""Share of the variance from which on a source is named."""


@dataclass(frozen=True)
class PlannedDemand:
    """A demand of [limits], and what a motion reaches.

    Attributes
    ----------
    key : str
    limit : float
    unit : str
    state : str
        The worst one.
    sd : float
        Of it, in `unit`.
    sources : tuple of (str, float)
        Where its variance comes from, the largest share first.
    motion : str
        What the motion does not show of it, in words; or "".
    """

    key: str
    limit: float
    unit: str
    state: str
    sd: float
    sources: tuple[tuple[str, float], ...]
    motion: str

    @property
    def met(self) -> bool:
        """Whether the motion reaches it."""
        return self.sd <= self.limit


@dataclass(frozen=True)
class Reached:
    """How much of a programme meets every demand.

    Attributes
    ----------
    name, words : str
        The programme and the size of it.
    minutes : float
    left : PlannedDemand or None
        The worst demand, where this much does not meet it, which is all that was tried.
    refused : str
        Why no recording of the programme would be calibrated; "" where it would.
    """

    name: str
    words: str
    minutes: float
    left: PlannedDemand | None = None
    refused: str = ""


@dataclass(frozen=True)
class ImuPlan:
    """A planned motion, its demands, and what would meet them."""

    done: DynamicUnit
    demands: tuple[PlannedDemand, ...]
    reached: tuple[Reached, ...]


def plan_demands(done: DynamicUnit, progress: Progress) -> ImuPlan:
    """What the plan `done` reaches of [limits], and which size of each programme meets them.

    Nothing is searched where nothing is demanded.
    """
    if not demanded(done.unit.limits, done.result.layout):
        return ImuPlan(done, (), ())
    programmes = programmes_of(done.unit)
    reached = [reach(done, programmes[0], progress)]
    for other in programmes[1:]:
        try:
            first = planned(done.unit, other, other.size, progress)
            reached.append(reach(first, other, progress))
        except RefusedError as refusal:
            reached.append(Reached(other.name, "", 0.0, refused=refusal.found))
    return ImuPlan(done, planned_demands(done), tuple(reached))


def planned_demands(done: DynamicUnit) -> tuple[PlannedDemand, ...]:
    """Every stated demand, its worst state, and what limits it."""
    result, layout = done.result, done.result.layout
    assert done.recording is not None
    shares = variance_shares(done.recording, result)
    found = []
    for demand, limit, index in demanded(done.unit.limits, layout):
        worst = max(index, key=lambda i: float(result.sd[i]) / layout.states[i].per_unit)
        state = layout.states[worst]
        parts = sorted(((name, float(v[worst])) for name, v in shares.items()), key=lambda p: -p[1])
        sources = tuple(part for part in parts if part[1] >= NAMED)
        sd = float(result.sd[worst]) / state.per_unit
        motion = _motion_words(done, state.name, dict(parts)[PRIOR])
        found.append(PlannedDemand(demand.key, limit, demand.unit, state.name, sd, sources, motion))
    return tuple(found)


def _motion_words(done: DynamicUnit, name: str, prior: float) -> str:
    """What the motion does not show of a state."""
    for names in done.seen.unseen:
        if name in names:
            others = [other for other in names if other != name]
            return "not seen in this motion" + (f", with {' and '.join(others)}" if others else "")
    for weak in done.seen.weak:
        if name in {n.lstrip("-") for n in weak.names}:
            return f"this motion shows {' and '.join(weak.names)} badly together"
    for a, b, _ in done.seen.together:
        if name in (a, b):
            return f"only together with {b if name == a else a}"
    return "little more than the prior" if prior > 0.5 else ""


def _worst(done: DynamicUnit) -> float:
    """Largest standard deviation over its limit."""
    result, states = done.result, done.result.layout.states
    found = [
        float(result.sd[i]) / states[i].per_unit / limit
        for _, limit, index in demanded(done.unit.limits, result.layout)
        for i in index
    ]
    return max(found)


def reach(done: DynamicUnit, programme: Programme, progress: Progress) -> Reached:
    """From what a programme of its usual size determines to the size that meets all demands."""
    size, best = programme.size, None
    for _ in range(ROUNDS):
        ratio = _worst(done)
        if ratio <= 1.0 and (best is None or size < best[0]):
            best = size, done
        wanted = min(max(size * ratio**2 * MARGIN, programme.least), programme.most)
        enough = SPARE < ratio <= 1.0 or (best is not None and wanted >= best[0])
        if enough or abs(wanted - size) < SAME * size:
            break
        size = wanted
        done = planned(done.unit, programme, size, progress)
    left = None
    if best is None:
        left = max(planned_demands(done), key=lambda demand: demand.sd / demand.limit)
    else:
        size, done = best
    minutes = done.result.survey.duration_s / 60
    return Reached(programme.name, programme.said(size), minutes, left)
