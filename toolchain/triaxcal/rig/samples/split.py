"""Frames of one bus given to the units that sent them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from triaxcal.rig.bus.frames import ERR_FLAG, Frames
from triaxcal.rig.description.description import RigDescription

_NOBODY, _ALL = -1, -2


class Splitter:
    """Splits frames by their IDs; those of nobody are dropped, error frames go to all."""

    def __init__(self, rigs: Sequence[RigDescription]) -> None:
        self._rigs = tuple(rigs)
        self._owners: dict[int, int] = {}

    def split(self, frames: Frames) -> list[Frames]:
        """Frames of each unit, in their order."""
        if len(self._rigs) == 1:
            return [frames]
        ids, place = np.unique(frames.can_id, return_inverse=True)
        owners = np.array([self._owner(i) for i in ids.tolist()], np.int64)[place]
        errors = owners == _ALL
        if errors.any():
            return [frames.take((owners == k) | errors) for k in range(len(self._rigs))]
        order = np.argsort(owners, kind="stable")
        ends = np.searchsorted(owners[order], np.arange(len(self._rigs) + 1))
        return [frames.take(order[a:b]) for a, b in pairwise(ends.tolist())]

    def _owner(self, can_id: int) -> int:
        """Place of the unit that sends an ID with flags."""
        if can_id & ERR_FLAG:
            return _ALL
        if can_id not in self._owners:
            one = np.array([can_id], np.uint32)
            mine = (
                k
                for k, rig in enumerate(self._rigs)
                if any(use.layout.mine(one)[0] for use in rig.messages.values())
            )
            self._owners[can_id] = next(mine, _NOBODY)
        return self._owners[can_id]
