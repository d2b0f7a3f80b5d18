"""Counters of messages that number no samples: frames lost, and two nodes under one ID."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from triaxcal.model.types import IntArray
from triaxcal.rig.bus.frames import ByteArray
from triaxcal.rig.description.description import RigDescription
from triaxcal.rig.description.rows import Rows

_MOST_LOST = 255
"""Frames counted for one step of a counter: after a restart it means nothing."""


class FrameCounters:
    """Watches counters, remembering the last frame of each message.

    Parameters
    ----------
    counted : collection of str
        Messages whose counters number samples; they are not looked at.
    """

    def __init__(self, rig: RigDescription, counted: Collection[str]) -> None:
        self._uses = {
            name: use
            for name, use in rig.messages.items()
            if use.counter is not None and name not in counted
        }
        # Frames of a multiplexed message may share a counter; a thermometer may have its sample's.
        self._own = {n for n in rig.axis_messages if not rig.messages[n].layout.multiplexed}
        self._last: dict[str, tuple[int, ByteArray]] = {}

    def feed(self, rows: Mapping[str, Rows]) -> tuple[IntArray, IntArray]:
        """Places after losses, once a frame lost; places of equal counters with other payloads."""
        lost_at, other_at = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
        for name, use in self._uses.items():
            mine = rows[name]
            if use.counter is None or not len(mine):
                continue
            counter, modulus = use.sequence(mine.data), use.turn
            before, payload = self._last.get(name, ((int(counter[0]) - 1) % modulus, mine.data[0]))
            self._last[name] = int(counter[-1]), mine.data[-1].copy()
            step = np.diff(counter, prepend=before)
            still = step == 0
            lost = np.where(still, 0, (step - 1) % modulus)
            if lost.any():
                lost_at.append(np.repeat(mine.place, np.minimum(lost, _MOST_LOST)))
            if name in self._own and still.any():
                width = min(len(payload), mine.data.shape[1])
                data = mine.data[:, :width]
                earlier = np.concatenate([payload[None, :width], data[:-1]])
                other_at.append(mine.place[still & (data != earlier).any(axis=1)])
        return np.sort(np.concatenate(lost_at)), np.sort(np.concatenate(other_at))
