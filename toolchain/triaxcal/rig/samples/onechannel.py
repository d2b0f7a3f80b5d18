"""One sensor from one channel: a log may have several buses on which IDs are equal."""

from __future__ import annotations

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.types import IntArray
from triaxcal.rig.bus.frames import Frames
from triaxcal.rig.description.description import MessageUse, RigDescription

_TOGETHER_NS = 1_000_000_000
"""Channels that change within this time are used at once; a cable takes longer to change over."""
_CHANGES = 4
"""As many in a second come from two sensors; one line of a log with a flipped bit makes two."""


class OneChannel:
    """Refuses a message that comes on two channels at once."""

    def __init__(self, rig: RigDescription) -> None:
        self._rig = rig
        self._last: dict[str, tuple[bytes, int]] = {}
        self._changed_ns: dict[str, IntArray] = {}

    def watch(self, frames: Frames) -> None:
        """Look at the channels of messages for which none is chosen.

        Raises
        ------
        RefusedError
            When a message comes on two channels in turn within a second.
        """
        for name, use in self._rig.messages.items():
            if use.channel is None:
                self._watch(name, use, frames)

    def _watch(self, name: str, use: MessageUse, frames: Frames) -> None:
        places = np.flatnonzero(use.layout.mine(frames.can_id))
        if not len(places):
            return
        channel, t_ns = frames.channel[places], frames.t_ns[places]
        before, before_ns = self._last.get(name, (channel[0], 0))
        self._last[name] = channel[-1], int(t_ns[-1])
        if before == channel[0] and (channel == channel[0]).all():
            return
        earlier = np.concatenate([np.array([before], np.bytes_), channel[:-1]])
        pause_ns = np.diff(t_ns, prepend=before_ns)
        at = np.flatnonzero((earlier != channel) & (pause_ns < _TOGETHER_NS))
        if not len(at):
            return
        known_ns = self._changed_ns.get(name, t_ns[:0])
        changed_ns = np.concatenate([known_ns, t_ns[at]])
        self._changed_ns[name] = changed_ns[1 - _CHANGES :]
        apart_ns = changed_ns[_CHANGES - 1 :] - changed_ns[: 1 - _CHANGES]
        if (apart_ns < _TOGETHER_NS).any():
            both = sorted(c.decode("ascii", "replace") for c in (earlier[at[0]], channel[at[0]]))
            raise RefusedError(
                f"{self._rig.name}, {name}",
                f"ID 0x{use.layout.frame_id:X} comes on several channels: {', '.join(both)}",
                expected="one sensor",
                remedy=f'state channel = "{both[0]}" in [rig] of rig.toml, or keep the frames of '
                "one channel",
            )
