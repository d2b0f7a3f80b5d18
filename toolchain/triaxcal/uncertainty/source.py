"""One source of uncertainty: what is known of it, and what it does."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from triaxcal.model.types import FloatArray
from triaxcal.uncertainty.propagation import Curves, square

NORMAL, RECTANGULAR, STUDENT = "normal", "rectangular", "Student"
ASSUMED_DOF = 8.0
"""A value that is only assumed is believed to a quarter: 1 / (2 · 0.25^2), GUM (G.3)."""


@dataclass(frozen=True)
class Source:
    """A source and its effect on the twelve constants and on the compensated acceleration.

    Attributes
    ----------
    key : str
        For machines.
    name : str
        For readers, as the subject of a sentence.
    unit : str
    advice : str
        What would make it smaller.
    origin : str
        Where `sd` comes from, in words.
    sd : float or None
        Standard uncertainty of the source itself, in `unit`; None where it is unknown.
    distribution : str
    dof : float
    assumed : bool
        Whether `sd` is a guess.
    constants, force : array, shape (n, 12, 12), or None
        Covariance of [K U0] and of D (`uncertainty.propagation`) at the temperatures; None where
        the source does not act. `force` is (n, 30, 30) where D goes on with Q (3 x 6).
    offset : bool
        Whether its effect is a known error that is not corrected, and no standard deviation: the
        interval is that of `coverage.with_offset`.
    """

    key: str
    name: str
    unit: str
    advice: str
    origin: str
    sd: float | None = None
    distribution: str = "unknown"
    dof: float = math.inf
    assumed: bool = False
    constants: FloatArray | None = None
    force: FloatArray | None = None
    offset: bool = False

    @property
    def unknown(self) -> bool:
        """Whether nothing is known of its size."""
        return self.sd is None


def from_factor(p: Curves, factor: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Covariances of constants and of force from the factor (n, 12, m) of [K U0]."""
    return square(factor), square(p.force_factor(factor))


def direct(p: Curves, factor_g: FloatArray) -> FloatArray:
    """Covariance of D of errors (n, 3, m) of the force that do not depend on it, in g."""
    blocks = np.zeros((len(p.temps_degc), 3, 4, factor_g.shape[-1]))
    blocks[:, :, 3] = factor_g
    return square(blocks.reshape(len(p.temps_degc), 12, -1))
