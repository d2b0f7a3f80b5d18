"""A compensation method: which functions of temperature the device evaluates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from triaxcal.model.curves import PiecewisePolynomial, ThermalModel

DIRECT = "direct"
INVERSE = "inverse"


@dataclass(frozen=True)
class Target:
    """What a method may use, and what it must reach.

    Attributes
    ----------
    curves : PiecewisePolynomial
        K (V/g) and U0 (V) as fitted, over the working range alone.
    voltage_max_v : float
        Largest |U_j|.
    error_max_g : float
        Largest error against K(T)^-1 (U - U0(T)).
    order_min : int
        Lowest order of functions that are fitted to them.
    """

    curves: PiecewisePolynomial
    voltage_max_v: float
    error_max_g: float
    order_min: int = 1


@dataclass(frozen=True)
class Column:
    """What tables and pictures need of one way to compute the force.

    Attributes
    ----------
    name, label, doc : str
        For files, for readers, and what it computes.
    short_label : str
        For the head of a narrow column.
    colour : str
        Of its lines in pictures.
    """

    name: str
    label: str
    doc: str
    short_label: str
    colour: str


@dataclass(frozen=True)
class CompensationMethod(Column):
    """Entry of a compensation method.

    Attributes
    ----------
    form : str
        "direct": functions are N (g/V, row by row) and b (g), a = N U + b.
        "inverse": functions are K (V/g) and U0 (V), a = K^-1 (U - U0).
    functions : callable
        Twelve functions, matrix row by row and then the offset, of the fitted model and a `Target`.
    keeps_error : bool
        Whether it aims at the target's error, so that missing it is refused.
    rank : int
        Place among the methods; the first is the default.
    """

    form: str
    functions: Callable[[ThermalModel, Target], PiecewisePolynomial]
    keeps_error: bool = False
    rank: int = 100
