"""Frames of one message: found, checked, cut into columns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.model.types import IntArray
from triaxcal.rig.bus.frames import BoolArray, ByteArray, Frames
from triaxcal.rig.description.description import MessageUse, Status
from triaxcal.rig.description.layout import Condition
from triaxcal.rig.description.signals import Signal

_CLASSIC = 8
_J1939_LAST = 0xFA
"""Largest highest byte of a number that is one; above are error and not available (J1939-71)."""


@dataclass(frozen=True)
class Rows:
    """Good frames of one message.

    Attributes
    ----------
    place : int64 array, shape (n,)
        Place of the frame among all since the start.
    t_ns : int64 array, shape (n,)
    data : uint8 array, shape (n, bytes)
    """

    place: IntArray
    t_ns: IntArray
    data: ByteArray

    def __len__(self) -> int:
        return len(self.place)

    def where(self, conditions: tuple[Condition, ...]) -> Rows:
        """Those for which all conditions hold."""
        rows = self
        for condition in conditions:
            rows = rows.take(condition.holds(rows.data))
        return rows

    def take(self, index: BoolArray | IntArray) -> Rows:
        """Some of them."""
        return Rows(self.place[index], self.t_ns[index], self.data[index])


def rows_of(use: MessageUse, frames: Frames, seen: int) -> tuple[Rows, IntArray]:
    """Good frames of a message, and the places of its bad ones: length, kind or CRC.

    Parameters
    ----------
    seen : int
        Frames before these.
    """
    places = np.flatnonzero(use.mine(frames))
    width = use.layout.size
    data = frames.data
    if not len(places):
        nothing = np.zeros((0, max(width, _CLASSIC)), np.uint8)
        return Rows(places, places, nothing), places
    if width <= _CLASSIC < data.shape[1]:
        data = data[:, :_CLASSIC]
    data = data[places]
    good = is_good(use, frames.length[places], frames.fd[places], data)
    bad = places[:0]
    if not good.all():
        bad, places, data = places[~good], places[good], data[good]
    return Rows(places + seen, frames.t_ns[places], data).where(use.only), bad + seen


def is_good(use: MessageUse, length: ByteArray, fd: BoolArray, data: ByteArray) -> BoolArray:
    """Which frames of a message, (n,) and payloads (n, bytes), have its length, kind and CRC."""
    layout = use.layout
    good: BoolArray = (length == layout.sent_bytes) & (fd == layout.fd)
    if use.guard is None or use.protection is None or not good.any():
        return good
    payload = data[:, : layout.size]
    good &= use.guard.signal.raw(payload) == use.protection.crc(use.guard, payload)
    return good


def status_of(use: MessageUse, data: ByteArray) -> IntArray | None:
    """Status of payloads (n, bytes): 0 good, else the bits that differ; None without one.

    Of several statuses the bits are or-ed.
    """
    said = [_off(status, data) for status in use.statuses]
    return np.bitwise_or.reduce(said) if said else None


def _off(status: Status, data: ByteArray) -> IntArray:
    """Bits in which a status differs from a good one; 0 where it is good."""
    raw, good = status.signal.raw(data), status.good
    if good == (0,):
        return raw
    return np.where(np.isin(raw, good), 0, np.maximum(raw ^ good[0], 1))


def available(use: MessageUse, signal: Signal, numbers: np.ndarray) -> BoolArray | None:
    """Which numbers of a signal are numbers; None where all are."""
    if signal.is_float:
        finite = np.isfinite(numbers)
        return None if finite.all() else np.asarray(finite, np.bool_)
    there: BoolArray | None = None
    if signal.no_values:
        none = np.array([raw % 2**64 for raw, _ in signal.no_values], np.uint64)
        there = ~np.isin(numbers.view(np.uint64), none)
    if use.layout.j1939 and not signal.signed and signal.length >= 8:
        known = np.asarray(numbers >> (signal.length - 8) <= _J1939_LAST, np.bool_)
        there = known if there is None else there & known
    return None if there is None or there.all() else there
