"""What goes into a pass of the filter and what comes out of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.preintegrate import BlockEquations
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.dynamic.survey import Survey
from triaxcal.dynamic.wander import Wander
from triaxcal.dynamic.window import Frame
from triaxcal.model.types import BoolArray, FloatArray, IntArray


class Watch(Protocol):
    """What looks at the equations of a pass beside the filter."""

    def level(self, time_s: FloatArray) -> BoolArray:
        """Whether the attitude may be levelled by the forces at these times."""

    def segment(self, time_s: FloatArray, made: BlockEquations) -> None:
        """Take the equations of consecutive blocks; `time_s`, shape (b + 1,), are their ends."""


@dataclass(frozen=True)
class Task:
    """What all of a pass is about.

    Attributes
    ----------
    cuts_s : tuple of float
        Rising times at which the filter forgets the attitude: what lies before and after shares
        the constants alone.
    watch : Watch or None
    renewed : array
        Places of states that are new after each cut.
    """

    recording: ImuRecording
    survey: Survey
    frame: Frame
    noise: DataSheet
    wander: Wander
    cuts_s: tuple[float, ...] = ()
    watch: Watch | None = None
    renewed: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))


@dataclass(frozen=True)
class Reference:
    """About what a pass is linearised.

    Attributes
    ----------
    p : array, shape (n,)
        Constants, SI.
    stage_p : array, shape (stages, r)
        Those that are new at each mounting (`Layout.reset_columns`), for each.
    heading_rad : array, shape (sections,), or None
        Turn about up from the level frame of each alignment to east, north, up; None while unknown.
    """

    p: FloatArray
    stage_p: FloatArray
    heading_rad: FloatArray | None


@dataclass
class History:
    """What the filter thought at each checkpoint: lists of equal length."""

    time_s: list[float] = field(default_factory=list)
    p: list[FloatArray] = field(default_factory=list)
    sd: list[FloatArray] = field(default_factory=list)
    chi_square: list[float] = field(default_factory=list)
    freedom: list[int] = field(default_factory=list)


@dataclass(frozen=True)
class PassResult:
    """End of a pass.

    Attributes
    ----------
    p : array, shape (n,)
        Constants, SI.
    root : array, shape (n, m)
        root root^T is their covariance.
    stage_p : array, shape (stages, r)
    north : array, shape (sections, 2, 2)
        Horizontal rate of the Earth in each section's level frame and its standard deviations,
        rad/s; only while the heading is unknown.
    heading_change_rad : array, shape (sections,)
        Error of each section's heading, as estimated at its end.
    history : History
    chi_square, freedom : float, int
    """

    p: FloatArray
    root: FloatArray
    stage_p: FloatArray
    north: FloatArray
    heading_change_rad: FloatArray
    history: History
    chi_square: float
    freedom: int
