"""Chambers and positioners: what every driver does, and the registry of drivers.

A driver carries an order to an instrument and brings numbers back. It knows nothing of
temperatures and positions: the same driver serves a chamber and a positioner.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import Key, keys_of
from triaxcal.base.registry import Registry
from triaxcal.base.tomltable import shown

_NUMBER = re.compile(r"(?<![A-Za-z0-9_.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
OPERATOR = "operator"
"""Driver of what a person does."""


@dataclass(frozen=True)
class Order:
    """What an instrument is told.

    Attributes
    ----------
    words : mapping
        For texts, by the names that stand between braces.
    numbers : tuple of float
        For registers and signals, in the instrument's unit.
    """

    words: Mapping[str, float | str]
    numbers: tuple[float, ...]


class Instrument(Protocol):
    """A connection to one instrument; every call ends within the time-out it was opened with."""

    def write(self, order: Order, /) -> None:
        """Tell it."""

    def read(self) -> Sequence[float]:
        """Numbers of its answer."""

    def close(self) -> None:
        """Give the connection back."""


@dataclass(frozen=True)
class Driver:
    """A way to speak to instruments: an entry of `DRIVERS`.

    Attributes
    ----------
    name, label, doc : str
        Value of the key `driver`; for readers; what it speaks.
    settings : type
        Dataclass of its keys, which stand in [chamber] and [positioner]. Their names begin with
        the driver's.
    open : callable
        Instrument of settings and a time-out in seconds; imports the packages that it needs.
    needs : tuple of str
        Keys that must be given.
    texts : tuple of str
        Keys with names in braces, filled from `Order.words`.
    reads : str
        Key without which it cannot be asked; "" for a driver that never can.
    files : tuple of str
        Keys that name a file, from the plan's folder.
    packages : tuple of str
        Modules of the extra "instruments" that it imports.
    rank : int
        Place in lists.
    """

    name: str
    label: str
    doc: str
    settings: type[Any]
    open: Callable[[Any, float], Instrument]
    needs: tuple[str, ...] = ()
    texts: tuple[str, ...] = ()
    reads: str = ""
    files: tuple[str, ...] = ()
    packages: tuple[str, ...] = ()
    rank: int = 100

    @property
    def keys(self) -> tuple[Key[Any], ...]:
        """Keys of its settings."""
        return keys_of(self.settings)


DRIVERS = Registry("instrument driver", "triaxcal.rig.hands.drivers", Driver, ("settings", "open"))


def filled(text: str, order: Order) -> str:
    """Text with the order's words between its braces, as `str.format`."""
    return text.format(**order.words)


def numbers_in(answer: str, asked: str) -> tuple[float, ...]:
    """Numbers of an instrument's answer.

    Raises
    ------
    RefusedError
        When there is none.
    """
    found = tuple(float(text) for text in _NUMBER.findall(answer))
    if not found:
        raise RefusedError(asked, f"answered {shown(answer.strip())}", expected="a number")
    return found
