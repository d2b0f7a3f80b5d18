"""Rates of messages whose axes are joined by age: a slower one would be used more than once."""

from __future__ import annotations

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.types import IntArray
from triaxcal.rig.description.description import RigDescription
from triaxcal.rig.samples.join import Part
from triaxcal.rig.samples.parts import PartPlan

_LOOKED_AT_S = 2
"""Samples of this time, by the plan's rate, are enough to tell a rate from its half."""
_SLOW_RATIO = 0.9
"""Of the lead's frames; a message that loses so many is no better than a slow one."""


class RateWatch:
    """Compares the first frames of each part with those of the part that makes the sample.

    Parameters
    ----------
    lead : int
        Place of the part that makes the sample.
    """

    def __init__(self, rig: RigDescription, plans: list[PartPlan], lead: int, rate_hz: int) -> None:
        self._rig = rig
        self._plans = plans
        self._lead = lead
        self._need = _LOOKED_AT_S * rate_hz + 1
        self._places: list[IntArray] = [np.zeros(0, np.int64) for _ in plans]
        self._t_ns = np.zeros(0, np.int64)
        self._done = False

    def feed(self, parts: list[Part]) -> None:
        """Look at the next rows.

        Raises
        ------
        RefusedError
            When another part is slower than the lead.
        """
        if self._done:
            return
        self._places = [
            np.concatenate([known, part.place])
            for known, part in zip(self._places, parts, strict=True)
        ]
        self._t_ns = np.concatenate([self._t_ns, parts[self._lead].t_ns])
        if len(self._t_ns) < self._need:
            return
        self._done = True
        lead = self._places[self._lead]
        first, last = lead[0], lead[self._need - 1]
        counts = [int(((first < p) & (p <= last)).sum()) for p in self._places]
        seconds = max(int(self._t_ns[self._need - 1] - self._t_ns[0]) * 1e-9, 1e-9)
        slow = min((i for i, n in enumerate(counts) if n), key=counts.__getitem__)
        if counts[slow] >= _SLOW_RATIO * counts[self._lead]:
            return
        name, rate = self._plans[slow].use.name, counts[slow] / seconds
        raise RefusedError(
            f"{self._rig.name}, [signals] sample_at",
            f"{self._rig.sample_at} comes {counts[self._lead] / seconds:.4g} times a second and "
            f"{name} {rate:.4g} times: its values would be used more than once",
            expected="the slowest message of an axis",
            remedy=f'sample_at = "{name}", and rate_hz = {rate:.0f} in the plan',
        )
