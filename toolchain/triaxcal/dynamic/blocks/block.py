"""What a block of states is: its states and prior, and how they enter.

Every effect of P2 is linear in its own states p, so a block gives matrices only, "rows" of shape
(points, 3, states): the derivative of an error in p, at the given signals. Where they enter:

rate     error of the measured rate, on the gyros' axes
force    error of the measured force, on the accelerometers' axes
motion   what the accelerometers feel besides the gravity at the time stamp, on the instrument axes
edges    the same, given as the change of a velocity between the ends of a block of samples

The engine (preintegrate) rotates them, integrates them and takes their means.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from triaxcal.model.types import FloatArray


@dataclass(frozen=True)
class State:
    """One state.

    Attributes
    ----------
    name : str
        As in P2, ASCII.
    unit : str
        In which it is shown.
    per_unit : float
        SI value of one `unit`.
    prior_sd : float
        In `unit`: standard deviation before the recording, mean zero.
    label : str
        For people, as "bias of accelerometer x".
    """

    name: str
    unit: str
    per_unit: float
    prior_sd: float
    label: str


AXIS = " xyz"
"""Letters of the axes 1, 2, 3."""


@dataclass(frozen=True)
class Signals:
    """True motion as known so far, at some points in time.

    Attributes
    ----------
    rate : array, shape (n, 3)
        Angular rate against inertial space, rad/s, instrument axes.
    turn : array, shape (n, 3)
        Angular rate against the Earth, rad/s, instrument axes.
    force : array, shape (n, 3)
        Specific force at M, m/s^2, instrument axes.
    delta_degc : array, shape (n,)
        Temperature of the sensors that the rows are for less the reference temperature; zero where
        none was recorded.
    gravity : float
        m/s^2.
    acceleration : array, shape (n, 3), or None
        Rate of change of the angular rate, rad/s^2, where it is known.
    jerk : array, shape (n, 3), or None
        How fast what the accelerometers feel besides gravity changes, m/s^3, where it is known.
    triad : array, shape (3, 3), or None
        Rows are the sensitive axes of the accelerometers that the rows are for, 1 + Gamma.
    """

    rate: FloatArray
    turn: FloatArray
    force: FloatArray
    delta_degc: FloatArray
    gravity: float
    acceleration: FloatArray | None = None
    jerk: FloatArray | None = None
    triad: FloatArray | None = None

    @property
    def load(self) -> FloatArray:
        """Specific force in units of local gravity, shape (n, 3)."""
        loaded: FloatArray = self.force / self.gravity
        return loaded


Rows = Callable[[Signals], FloatArray]


@dataclass(frozen=True)
class StateBlock:
    """One effect; the callables give rows of shape (points, 3, states), see the module's text.

    Attributes
    ----------
    name : str
        By which it is switched on.
    title : str
        Text for readers.
    states : tuple of State
    rate, force, motion, edges, force2, motion2, edges2 : callables, or None
        Rows; the names with 2 belong to the second accelerometer triad.
    table : callable, or None
        Rows of the unit's turn against the table's plate, rad.
    motion_curve : callable, or None
        The exact error for p, shape (points, 3), where rows p is not good enough.
    reset : bool
        Whether the states are new each time the unit is put on the table anew.
    needs : str
        Column that must be recorded: "temp_degc", "force2", "table_angle_rad"; "table" for the
        table's axis in unit.toml; or "".
    weak : str
        For readers: what it is that a usual motion shows badly, and what would show it; or "".
    shown : bool
        Whether its states are for readers; those of others are terms of a calculation.
    """

    name: str
    title: str
    states: tuple[State, ...]
    rate: Rows | None = None
    force: Rows | None = None
    motion: Rows | None = None
    edges: Rows | None = None
    force2: Rows | None = None
    motion2: Rows | None = None
    edges2: Rows | None = None
    table: Rows | None = None
    motion_curve: Callable[[Signals, FloatArray], FloatArray] | None = None
    reset: bool = False
    needs: str = ""
    weak: str = ""
    shown: bool = True


@dataclass(frozen=True)
class Extension:
    """What is switched on by one name: one block, or some that make no sense without each other."""

    name: str
    label: str
    doc: str
    blocks: tuple[StateBlock, ...]


def extension(block: StateBlock, doc: str, *before: StateBlock) -> Extension:
    """Extension of one block, by its name and title; `before` are blocks that it needs."""
    return Extension(block.name, block.title, doc, (*before, block))


def spread(values: FloatArray) -> FloatArray:
    """Rows of a full 3 x 3 matrix of states acting on `values` (n, 3): shape (n, 3, 9), by rows."""
    n = len(values)
    rows = np.zeros((n, 3, 3, 3))
    for i in range(3):
        rows[:, i, i] = values
    return rows.reshape(n, 3, 9)


def diagonal(values: FloatArray) -> FloatArray:
    """Rows of three states, each acting on its own axis' `values` (n, 3): shape (n, 3, 3)."""
    rows = np.zeros((len(values), 3, 3))
    axes = np.arange(3)
    rows[:, axes, axes] = values
    return rows


def bias_rows(signals: Signals) -> FloatArray:
    """Rows of three biases: shape (n, 3, 3)."""
    return same(len(signals.force))


def same(n: int) -> FloatArray:
    """Rows of three states that are the error itself: shape (n, 3, 3)."""
    return np.broadcast_to(np.eye(3), (n, 3, 3))
