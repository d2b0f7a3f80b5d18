"""The chamber of an unattended run: told, asked, judged."""

from __future__ import annotations

import math
from collections.abc import Callable

from triaxcal.base.errors import RefusedError
from triaxcal.rig.hands.equipment import TEMP_UNITS, Chamber
from triaxcal.rig.hands.link import Link, Numbers

_NAME = "chamber"
_OTHER_UNIT_K = 3.0
"""So near to the unit's temperature a number must be in another unit to be taken for one in it."""
_STEP_K = 0.1
"""Of a set point that is moved: finer steps than a chamber has."""


class ChamberHand:
    """Sets the chamber and watches it."""

    def __init__(
        self, chamber: Chamber, link: Link, readable: bool, say: Callable[[str], None]
    ) -> None:
        self.degc: float | None = None
        self._chamber = chamber
        self._link = link
        self._readable = readable
        self._say = say
        self._target: float | None = None
        self._told: float | None = None
        self._start = self._since = self._next = self._moved = 0.0
        self._way = (math.inf, -math.inf)

    def tend(self, now_s: float, target_degc: float, unit_degc: float | None) -> None:
        """Bring it to a temperature and keep it there; one look at it.

        Raises
        ------
        RefusedError
            When it does not answer, answers in another unit, or leaves its way.
        """
        answer = self._link.collect(now_s)
        if answer:
            self._take(answer, unit_degc)
        if unit_degc is None:
            return
        self._refuse_astray(unit_degc, "the unit")
        if self._link.busy:
            return
        if self._readable and (self.degc is None or now_s >= self._next):
            self._next = now_s + self._chamber.poll_s
            self._link.ask(lambda instrument: instrument.read(), now_s)
            return
        self._aim(now_s, target_degc, unit_degc)
        told = self._set_point(now_s)
        if told != self._told:
            order = self._chamber.order(told)
            self._told, self._moved = told, now_s
            self._link.ask(lambda instrument: instrument.write(order), now_s)

    def refuse_disagreement(self, unit_degc: float) -> None:
        """Refuse a chamber that says another temperature than the unit at equilibrium.

        Raises
        ------
        RefusedError
            Naming both.
        """
        if self.degc is None or abs(self.degc - unit_degc) <= self._chamber.agree_max_k:
            return
        raise RefusedError(
            _NAME,
            f"answers {self.degc:.1f} degC while the unit rests at {unit_degc:.1f} degC",
            expected=f"no more than agree_max_k, {self._chamber.agree_max_k:g} K, between them",
            remedy="check `unit` and `answer_place` in [chamber], and where the unit is mounted",
        )

    def make_safe(self) -> str:
        """Give the last order, and say how it went."""
        safe = self._chamber.safe_degc
        order = self._chamber.order(safe)
        failed = self._link.last_order(lambda instrument: instrument.write(order))
        if failed:
            return f"{_NAME}: NOT set to the safe {safe:g} degC, do it by hand: {failed}"
        return f"{_NAME}: set to the safe {safe:g} degC"

    def _aim(self, now_s: float, target_degc: float, unit_degc: float) -> None:
        if target_degc == self._target:
            return
        start = unit_degc if self.degc is None else self.degc
        over = self._chamber.overshoot_max_k
        ends = (start, unit_degc, target_degc)
        self._way = (min(ends) - over, max(ends) + over)
        self._target, self._since, self._start = target_degc, now_s, start
        self._say(f"{_NAME}: from {start:.1f} to {target_degc:g} degC")

    def _set_point(self, now_s: float) -> float:
        assert self._target is not None
        slew = self._chamber.slew_k_per_min / 60.0
        change = self._target - self._start
        if not slew or abs(change) <= slew * (now_s - self._since):
            return self._target
        if self._told is not None and now_s < self._moved + self._chamber.poll_s:
            return self._told
        moved = self._start + math.copysign(slew * (now_s - self._since), change)
        return round(round(moved / _STEP_K) * _STEP_K, 6)

    def _take(self, answer: Numbers, unit_degc: float | None) -> None:
        place = self._chamber.answer_place
        if len(answer) < place or not math.isfinite(answer[place - 1]):
            raise RefusedError(
                _NAME,
                f"answered {', '.join(f'{v:g}' for v in answer)}",
                expected=f"a temperature as number {place}",
                remedy="correct answer_place in [chamber]",
            )
        value = float(answer[place - 1])
        first = self.degc is None
        self.degc = self._chamber.unit.degc(value)
        if first and unit_degc is not None:
            self._refuse_other_unit(value, unit_degc)
        self._refuse_astray(self.degc, "it")

    def _refuse_other_unit(self, value: float, unit_degc: float) -> None:
        """Refuse a first answer that is the unit's temperature in another unit."""
        own = self._chamber.unit
        assert self.degc is not None
        off = abs(self.degc - unit_degc)
        for other in TEMP_UNITS.values():
            near = abs(other.degc(value) - unit_degc)
            if other is not own and near <= _OTHER_UNIT_K and off > 4.0 * _OTHER_UNIT_K:
                raise RefusedError(
                    _NAME,
                    f"answers {value:g}, which is {other.name}: the unit is at "
                    f"{unit_degc:.1f} degC",
                    expected=f"{own.name}, the key `unit` in [chamber]",
                    remedy=f'set unit = "{other.name}", or the instrument to {own.name}',
                )

    def _refuse_astray(self, degc: float, whose: str) -> None:
        low, high = self._way
        if self._target is None or low <= degc <= high:
            return
        raise RefusedError(
            _NAME,
            f"{whose} is at {degc:.1f} degC",
            expected=f"{low:.1f} to {high:.1f} degC on the way from {self._start:.1f} to "
            f"{self._target:g} degC",
            remedy="check the chamber; overshoot_max_k in [chamber] is the limit",
        )
