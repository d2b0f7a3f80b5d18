"""A thermal function: its entry makes shapes, a shape is a basis of functions to fit.

Each of the twelve constants is a sum of the P functions of a shape's basis. Every shape is a
piecewise polynomial, so that the plan of the firmware takes any of them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import Key
from triaxcal.model.curves import PiecewisePolynomial, ThermalModel
from triaxcal.model.types import FloatArray

GROUP_GAP_DEGC = 2.0
"""Readings nearer than this are at one temperature; also how near T0 its group must be."""
EDGE_DEGC = 0.5
"""How far beyond the calibrated temperatures curves may be used."""
PLAUSIBLE_DEGC = (-200.0, 400.0)
"""Temperatures outside these are mistakes: no electronic accelerometer works there."""

Settings = Mapping[str, Any]
"""Values of a function's keys by name; None for a key that is absent."""


@dataclass(frozen=True)
class ThermalShape(ABC):
    """A basis of functions of temperature.

    Attributes
    ----------
    name : str
        Of the function's entry.
    within_points : bool
        Whether curves stay between neighbouring points that they pass: they cannot overshoot.
    t0_degc : float
        Reference temperature.
    ends_degc : tuple of two floats
        Lowest and highest calibrated temperature.
    """

    name: ClassVar[str]
    within_points: ClassVar[bool] = False

    t0_degc: float
    ends_degc: tuple[float, float]

    @property
    @abstractmethod
    def parameters(self) -> int:
        """P: parameters of each constant's curve."""

    @property
    @abstractmethod
    def detail(self) -> str:
        """What distinguishes shapes of one function, in two words: "order 3", "7 knots"."""

    @property
    @abstractmethod
    def label(self) -> str:
        """Words for tables and messages."""

    @property
    def short_label(self) -> str:
        """Words for a narrow column."""
        return self.label

    @property
    @abstractmethod
    def settings(self) -> Settings:
        """Values of the function's keys that give this shape."""

    @abstractmethod
    def basis(self, temp_degc: FloatArray | float) -> FloatArray:
        """Values of the P functions, shape (..., P), at temperatures of shape (...)."""

    @abstractmethod
    def curves(self, parameters: FloatArray) -> PiecewisePolynomial:
        """Exactly the same functions as polynomials, for parameters of shape (12, P)."""

    def nested(self, parameters: int) -> ThermalShape:
        """Shape of the first functions of the basis alone, where the function is nested."""
        raise NotImplementedError(f"{self.label} has no shape of {parameters} parameters in it")

    @abstractmethod
    def without(self, remaining_degc: FloatArray, held_out_degc: float) -> Self:
        """Shape that the calibrated temperatures determine when one of them is held out."""

    @abstractmethod
    def undetermined(self, where: str, temps_degc: FloatArray) -> RefusedError | None:
        """Why the calibrated temperatures do not determine the shape; `where` is unit.toml."""

    def model(self, parameters: FloatArray) -> ThermalModel:
        """Thermal model of parameters of shape (12, P)."""
        return ThermalModel(self.t0_degc, self.curves(parameters))


@dataclass(frozen=True)
class ThermalFunction:
    """Entry of a thermal function.

    Attributes
    ----------
    name, label, doc : str
        For unit.toml, for readers, and what it is.
    keys : tuple of Key
        Keys of [thermal] that go with it; each has a default.
    stated : callable
        Shapes for the settings in unit.toml, calibrated temperatures (G,) and T0. One shape is
        what the user asked for; of several the held-out error chooses.
    candidates : callable
        Shapes that "auto" tries for temperatures (G,) and T0, fewest parameters first.
    exact : callable
        The shape that passes all points, for temperatures (G,) and T0.
    nested : bool
        Whether the basis of each shape begins with that of the smaller ones, and `candidates`
        begin with the constant; recordings need such functions.
    least_temps : int
        Calibrated temperatures that it needs.
    rank : int
        Place among the functions; the first of equally good candidates is taken.
    """

    name: str
    label: str
    doc: str
    keys: tuple[Key[Any], ...]
    stated: Callable[[Settings, FloatArray, float], tuple[ThermalShape, ...]]
    candidates: Callable[[FloatArray, float], tuple[ThermalShape, ...]]
    exact: Callable[[FloatArray, float], ThermalShape]
    nested: bool = False
    least_temps: int = 1
    rank: int = 100


def ends_of(temps_degc: FloatArray) -> tuple[float, float]:
    """Lowest and highest of the temperatures."""
    return float(temps_degc.min()), float(temps_degc.max())


def listed(temps_degc: FloatArray) -> str:
    """Temperatures in words, without their unit."""
    return ", ".join(f"{t:.6g}" for t in np.asarray(temps_degc))
