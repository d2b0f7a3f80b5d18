"""What a cause did to the poses of a recording, and where."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from triaxcal.diagnosis.core.cause import SIZES_G, Cause, Parameter
from triaxcal.diagnosis.poses.core.readings import PoseReadings
from triaxcal.fitting.core.noise import NoisePrior
from triaxcal.fitting.recorded.wrong import WrongPoses
from triaxcal.model.types import BoolArray, FloatArray, IntArray
from triaxcal.unit.priors import Priors

PoseUndo = Callable[[PoseReadings, FloatArray], PoseReadings]
"""Poses and amplitudes (in g) -> the poses without the mistake."""


def unchanged(readings: PoseReadings, _amplitudes: FloatArray) -> PoseReadings:
    """Undo nothing: the cause explains some poses, the noise or the constants without that."""
    return readings


@dataclass(frozen=True)
class PoseHypothesis:
    """A cause at one place; as `diagnosis.core.cause.Hypothesis` is for dwells.

    Attributes
    ----------
    place, change : str
    undo : PoseUndo
    parameters : tuple of Parameter
        Amplitudes that the poses determine, with the prior standard deviations `sizes`.
    lines : array of int
        Of the poses that it is about.
    places : float
        How many places there are: each is as probable as the others.
    log_prior : float
        Logarithm of what makes the cause more or less probable than the others.
    unused : array of bool, shape (n,), or None
        Poses that the cause itself explains.
    density_per_g : float
        Of |a| of such a pose.
    noise : NoisePrior or None
        In place of the usual one.
    priors : Priors or None
        In place of [priors].
    """

    place: str
    undo: PoseUndo = unchanged
    parameters: tuple[Parameter, ...] = ()
    lines: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    change: str = ""
    places: float = 1.0
    log_prior: float = 0.0
    sizes: tuple[float, ...] = SIZES_G
    unused: BoolArray | None = None
    density_per_g: float = 1.0
    noise: NoisePrior | None = None
    priors: Priors | None = None


@dataclass(frozen=True)
class KnownPoses:
    """What a cause may look at when it lists its places.

    Attributes
    ----------
    readings : PoseReadings
    noise_g : float
        Of a pose of weight 1, by the fit of a sound unit.
    odd : tuple of int
        Poses that stand out most, one by one.
    wrong : WrongPoses or None
        The most probable set of wrong poses.
    priors : Priors
    unit : str
        Of the readings.
    """

    readings: PoseReadings
    noise_g: float
    odd: tuple[int, ...]
    wrong: WrongPoses | None
    priors: Priors
    unit: str


PoseCause: TypeAlias = Cause[KnownPoses, PoseHypothesis]
"""A cause of the poses of a recording."""
