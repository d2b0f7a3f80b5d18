"""The guide: what to turn next, until every demand is met.

After each rest the step model (`stepmodel`) says what the constants are known to, and what each
turn that can be asked for would make of it. The demand that is farthest from being met is served
first, by the turn that lowers it most for its time. Only a calibration of the recording, the same
that `triaxcal dynamic` makes, decides that the demands are met.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.calibrate import DynamicResult
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.recording import ImuSamples
from triaxcal.dynamic.restless import AXIS_TURN_MIN_RAD
from triaxcal.guide.goals import Goal, Standing, standings
from triaxcal.guide.stepmodel import StepModel
from triaxcal.guide.turns import Turn, candidates, up_words
from triaxcal.guide.watch import Motion, Watch
from triaxcal.model.types import FloatArray

HOLD_S, FIRST_HOLD_S = 5.0, 10.0
GUARD_S = 0.3
"""Of a rest, on each side, that is not counted: what lifts the unit starts slowly."""
EVERY = 8
"""Rests after which the recording is calibrated, whatever the step model says."""
AGAIN = 2
"""Rests after a calibration until the next."""
OTHER_RAD = math.radians(25.0)
"""Up after a turn is farther from where it was asked for: the operator made another turn."""

Submit = Callable[[Callable[[], DynamicResult]], "Future[DynamicResult]"]
"""Runs a calibration, here or in a thread."""


@dataclass(frozen=True)
class Setting:
    """What the guide knows beforehand.

    Attributes
    ----------
    layout : Layout
    noise : DataSheet
    gravity : float
        m/s^2.
    rate_hz : float
    goals : tuple of Goal
    """

    layout: Layout
    noise: DataSheet
    gravity: float
    rate_hz: float
    goals: tuple[Goal, ...]


@dataclass(frozen=True)
class Advice:
    """What the operator should do.

    Attributes
    ----------
    turn : Turn or None
        None: hold still as it is, for the first time.
    hold_s : float
        How long to hold still after it.
    up : array, shape (3,), or None
        Up before the turn.
    target : Standing or None
        What it is for.
    """

    turn: Turn | None
    hold_s: float
    up: FloatArray | None = None
    target: Standing | None = None

    @property
    def words(self) -> str:
        """In words."""
        if self.turn is None or self.up is None:
            return "put it down, any side up"
        return self.turn.words(self.up)


_FIRST = Advice(None, FIRST_HOLD_S)


class Guide:
    """Takes samples as they come, and says what to do.

    Parameters
    ----------
    calibrate : callable
        Calibrates the recording as it is when it is called; may refuse it.
    submit : callable
        Runs `calibrate`, here or in a thread.

    Attributes
    ----------
    advice : Advice
    rests, calibrations : int
        How many there were.
    done : DynamicResult or None
        The calibration that meets every demand.
    refusal : str
        Why the last calibration was refused; empty where it was not.
    notes : list of str
        What happened since they were last taken.
    """

    def __init__(
        self, setting: Setting, calibrate: Callable[[], DynamicResult], submit: Submit
    ) -> None:
        self.setting = setting
        self._calibrate, self._submit = calibrate, submit
        self._watch = Watch(setting.rate_hz)
        self._model = self._fresh()
        self._steps: list[Callable[[StepModel], object]] = []
        self._pending: Future[DynamicResult] | None = None
        self._from: tuple[int, FloatArray] = (0, np.zeros(3))
        self._taken_s = 0.0
        self._since = 0
        self._turned = np.zeros(3)
        self.advice = _FIRST
        self.rests = self.calibrations = 0
        self.done: DynamicResult | None = None
        self.refusal = ""
        self.notes: list[str] = []

    def _fresh(self, covariance: FloatArray | None = None) -> StepModel:
        setting = self.setting
        return StepModel(setting.layout, setting.noise, setting.gravity, covariance)

    @property
    def standings(self) -> tuple[Standing, ...]:
        """Where the demands stand: of the calibration that meets them, else as expected."""
        layout = self.setting.layout
        if self.done is None:
            return standings(self.setting.goals, layout, self._model.sd)
        return standings(self.setting.goals, layout, self.done.sd[: len(layout)])

    @property
    def resting_s(self) -> float:
        """Length of the present rest; 0 while the unit moves."""
        return self._watch.resting_s

    @property
    def held(self) -> bool:
        """Whether the present rest has been as long as was asked for."""
        return self._taken_s > 0.0

    @property
    def up(self) -> FloatArray | None:
        """Up at the present rest, else at the last one."""
        return self._watch.up

    def feed(self, samples: ImuSamples) -> None:
        """Look at more samples."""
        for motion in self._watch.feed(samples):
            self._moved(motion)
        if not self._taken_s and self.resting_s >= self.advice.hold_s:
            self._rested()
        if self._pending is not None and self._pending.done():
            self._calibrated()

    def finish(self) -> None:
        """Wait for a calibration that is under way."""
        if self._pending is not None:
            self._pending.exception()
            self._calibrated()

    def _apply(self, step: Callable[[StepModel], object]) -> None:
        self._steps.append(step)
        step(self._model)

    def _moved(self, motion: Motion) -> None:
        """The unit was moved, and rests again."""
        more_s = motion.before_s - max(self._taken_s, 2 * GUARD_S)
        if more_s > GUARD_S:
            self._apply(lambda model: model.rest(motion.before, more_s))
        self._taken_s = 0.0
        self._turned += np.abs(motion.rate).sum(axis=0) * motion.step_s
        self._apply(
            lambda model: model.moved(motion.rate, motion.ups, motion.to_end, motion.step_s)
        )
        asked = self.advice
        if asked.turn is not None and asked.up is not None and asked.turn.angle_deg:
            wanted = asked.turn.end(asked.up)
            if float(wanted @ motion.after) < math.cos(OTHER_RAD):
                self.notes.append(f"not the turn that was asked for: now {up_words(motion.after)}")
                self.advice = Advice(Turn(0, 0), HOLD_S, motion.after, asked.target)

    def _rested(self) -> None:
        """The unit has rested for as long as was asked for."""
        up = self._watch.up
        assert up is not None
        self._taken_s = self.resting_s
        counted_s = self._taken_s - 2 * GUARD_S
        self._apply(lambda model: model.rest(up, counted_s))
        self.rests += 1
        self._since += 1
        if self._pending is None and self._due():
            self._from, self._since = (len(self._steps), up), 0
            self._pending = self._submit(self._calibrate)
        if self._pending is not None and self._pending.done():
            self._calibrated()
        elif self.done is None:
            self.advice = self._next(up)

    def _due(self) -> bool:
        if self._since < AGAIN or self._missing():
            return False
        return self._since >= EVERY or self._met(self.standings)

    def _missing(self) -> list[int]:
        """Axes about which the unit has turned less than a calibration needs."""
        return [axis for axis in range(3) if self._turned[axis] < AXIS_TURN_MIN_RAD]

    def _met(self, found: Sequence[Standing]) -> bool:
        return all(s.reached for s in found) and any(math.isfinite(s.goal.demand) for s in found)

    def _calibrated(self) -> None:
        """A calibration has ended."""
        assert self._pending is not None
        ended, self._pending = self._pending, None
        self.calibrations += 1
        try:
            result = ended.result()
        except RefusedError as refusal:
            self.refusal = str(refusal)
        else:
            self.refusal = ""
            n = len(self.setting.layout)
            self._model = self._fresh(result.covariance[:n, :n])
            count, up = self._from
            self._model.level(up, HOLD_S)
            for step in self._steps[count:]:
                step(self._model)
            if self._met(standings(self.setting.goals, self.setting.layout, result.sd[:n])):
                self.done = result
                return
        up_now = self._watch.up
        if up_now is not None:
            self.advice = self._next(up_now)

    def _next(self, up: FloatArray) -> Advice:
        """The turn that lowers the demand farthest from being met most for its time."""
        goals = self.setting.goals
        target = max(self.standings, key=lambda s: s.ratio)
        places = [target.place] if target.ratio > 0 else [i for g in goals for i in g.places]
        before = np.log(self._model.sd[places]).sum()
        best, best_gain = Turn(0, 0), 0.0
        missing = self._missing() if self._met(self.standings) else []
        for turn in candidates(up, missing):
            model = self._model.copy()
            model.rest(model.turn(turn, up), HOLD_S - 2 * GUARD_S)
            seconds = turn.seconds + HOLD_S
            gain = float(before - np.log(model.sd[places]).sum()) / seconds
            # Of turns that are worth the same the first: rounding must not choose.
            if gain > best_gain * (1 + 1e-6):
                best, best_gain = turn, gain
        return Advice(best, HOLD_S, up, target if target.ratio > 0 else None)
