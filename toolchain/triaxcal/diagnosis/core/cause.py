"""What a cause is: the places where it can have struck, and what it did to the readings there."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Generic, TypeAlias, TypeVar

import numpy as np

from triaxcal.diagnosis.core.curves import BendFeatures, constants, residuals
from triaxcal.diagnosis.core.readings import Readings
from triaxcal.model.types import BoolArray, FloatArray, IntArray

Undo = Callable[[Readings, FloatArray], Readings]
"""Readings and amplitudes (in g or rad) -> the readings without the mistake."""
Size = float | FloatArray
"""Prior standard deviation of all amplitudes, or one of each, shape (k,)."""
SIZES_G = (0.5e-3, 5e-3, 50e-3, 500e-3)
"""Prior standard deviations of an amplitude; each as probable as the others."""
_SMALL = 1e-5
K = TypeVar("K")
"""What the hypotheses are made of: `Known`, or `poses.core.cause.KnownPoses`."""
H = TypeVar("H")
"""A place of the cause: `Hypothesis`, or `poses.core.cause.PoseHypothesis`."""


@dataclass(frozen=True)
class Parameter:
    """An amplitude as a reader sees it.

    Attributes
    ----------
    name, unit : str
    per_unit : float
        `unit` per g or rad of the amplitude.
    moves_g : float
        How far outputs are moved by an amplitude of 1, g.
    """

    name: str
    unit: str = "mg"
    per_unit: float = 1e3
    moves_g: float = 1.0


@dataclass(frozen=True)
class Hypothesis:
    """A cause at one place.

    Attributes
    ----------
    place : str
        "TP3", "rows 13-18": where, in words; "" where there is only one.
    undo : Undo
        Applied to further dwells as well it says what they would read: it must go by rows, blocks,
        positions and temperatures, and by no fixed arrays.
    parameters : tuple of Parameter
        Amplitudes that the readings determine.
    rows : array of int
        Lines of the file.
    change : str
        What undoing it changes: "+45 for -45 degC in rows 13-18".
    places : float
        How many places there are: each is as probable as the others.
    log_prior : float
        Logarithm of what makes this place less probable than others.
    sizes : tuple of float or of arrays, shape (k,)
        Prior standard deviations of the amplitudes, each as probable as the others.
    noise : tuple of float
        Factors on the stated noise that are tried instead of the usual ones.
    unused : array of bool, shape (n, 3), or None
        Outputs that the cause itself explains, with `log_density` (ln g^-1).
    spoils : bool
        As that of `Cause`, of this place of it.
    without_checks : bool
        Whether the check dwells say nothing, because a sensitivity is unknown.
    """

    place: str
    undo: Undo
    parameters: tuple[Parameter, ...] = ()
    rows: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    change: str = ""
    places: float = 1.0
    log_prior: float = 0.0
    sizes: tuple[Size, ...] = SIZES_G
    noise: tuple[float, ...] = ()
    unused: BoolArray | None = None
    log_density: float = 0.0
    spoils: bool = False
    without_checks: bool = False

    @property
    def blind(self) -> bool:
        """Whether an output or its sensitivity is lost: |a| in check positions is unknown then."""
        lost = self.unused is not None and (self.unused.sum(axis=0) > len(self.unused) / 3).any()
        return self.without_checks or bool(lost)

    def columns(self, readings: Readings, theta: FloatArray, about: FloatArray) -> FloatArray:
        """Effect of each amplitude on the rows, about some amplitudes, shape (n, k)."""
        undone = self.undo(readings, about)
        temps = undone.temps_degc
        at = constants(theta, temps, undone.t0_degc)
        base = residuals(undone, theta, at)
        effects = []
        for k in range(len(self.parameters)):
            step = np.zeros(len(self.parameters))
            step[k] = _SMALL
            moved = self.undo(readings, about + step)
            same = moved.temps_degc is temps  # most causes leave the temperatures alone
            effects.append((base - residuals(moved, theta, at if same else None)) / _SMALL)
        return np.stack(effects, axis=1)


def unchanged(readings: Readings, _amplitudes: FloatArray) -> Readings:
    """Undo nothing: the cause is about outputs that are not used, or about the noise."""
    return readings


def shifted(some: tuple[tuple[int, int], ...]) -> Undo:
    """Undo shifts of single outputs, each by its row of the file and its axis."""

    def undo(readings: Readings, amplitudes: FloatArray) -> Readings:
        changed = readings.outputs.copy()
        for (row, i), amplitude in zip(some, amplitudes, strict=True):
            changed[readings.rows == row, i] -= amplitude
        return readings.but(outputs=changed)

    return undo


def explained(log_density: float, count: int) -> float:
    """`log_density` of `count` outputs, for a model that takes them as normal of variance 1 g^2."""
    return log_density + 0.5 * count * float(np.log(2.0 * np.pi))


def falling(undo: Undo) -> Undo:
    """The same on a sensor all of whose outputs fall where the force rises."""

    def undone(readings: Readings, amplitudes: FloatArray) -> Readings:
        return undo(readings.but(outputs=-readings.outputs), amplitudes)

    return undone


@dataclass(frozen=True)
class Known:
    """What a cause may look at when it lists its places.

    Attributes
    ----------
    readings : Readings
    theta : array
        Constants of the first fit.
    odd_dwells : tuple of int
        Dwells that stand out most, one by one.
    standing_out : tuple of (dwell, output)
        What stands out most, then what does when that is left out, and so on.
    sensitivity_v_per_g : array, shape (3,), or None
        Nominal ones, where the description states them.
    tolerance : float
        Of the nominal sensitivity, relative.
    """

    readings: Readings
    theta: FloatArray
    odd_dwells: tuple[int, ...] = ()
    standing_out: tuple[tuple[int, int], ...] = ()
    sensitivity_v_per_g: FloatArray | None = None
    tolerance: float = 0.1

    @cached_property
    def bends(self) -> BendFeatures:
        """Functions of temperature that bend faster than the thermal functions."""
        return BendFeatures(self.readings.temps_degc)


@dataclass(frozen=True)
class Cause(Generic[K, H]):
    """One kind of mistake.

    Attributes
    ----------
    name, label, doc : str
        For files, for people, for the documentation.
    hypotheses : Callable
        Known -> the places where it can have struck; of a recording KnownPoses -> PoseHypothesis
        (`diagnosis.poses.core.cause`).
    apart : str
        The datum that would tell it from what looks the same.
    discrete : bool
        Whether undoing it changes labels or signs, and nothing by an amount.
    spoils : bool
        Whether the constants of readings with it are wrong: they are refused where it is certain
        and beyond the limit, however small their residuals are.
    alike : tuple of str
        Causes that explain the same readings, where there are no check dwells.
    symptom : bool
        Whether it says how the readings look, and not why: general advice on them still holds.
    rank : int
        Place in lists.
    """

    name: str
    label: str
    doc: str
    hypotheses: Callable[[K], Iterable[H]]
    apart: str
    discrete: bool = False
    spoils: bool = False
    alike: tuple[str, ...] = ()
    symptom: bool = False
    rank: int = 100


DwellCause: TypeAlias = "Cause[Known, Hypothesis]"
"""A cause of the dwells of a tilter, or of faces."""


def name_of(cause: DwellCause, hypothesis: Hypothesis) -> str:
    """Label and place, in words."""
    if not hypothesis.place:
        return cause.label
    comma = "" if hypothesis.place.startswith("about ") else ","
    return f"{cause.label}{comma} {hypothesis.place}"


def either(one: BoolArray | None, other: BoolArray | None) -> BoolArray | None:
    """Outputs that one or the other explains."""
    if one is None or other is None:
        return other if one is None else one
    return np.asarray(one | other)
