"""What readings say of their own fit: held-out errors, own-axis squares, runs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from triaxcal.fitting.core.outliers import CHANCE
from triaxcal.model.types import BoolArray, FloatArray
from triaxcal.unit.priors import AUTO, LINEAR

ORIENTATION, TEMPERATURE = "orientation", "temperature"


@dataclass(frozen=True)
class HeldOutPoses:
    """|a| - g at poses of a recording, by fits without them.

    Attributes
    ----------
    what : str
        `ORIENTATION` or `TEMPERATURE`: what was held out in turn.
    poses : tuple of int
        Indices of the poses.
    error_g : array, shape (n,)
    component_g : array, shape (n,), or None
        Rms error of the three components of the force, where their directions are known.
    """

    what: str
    poses: tuple[int, ...]
    error_g: FloatArray
    component_g: FloatArray | None = None


def held_out_poses(
    errors_g: FloatArray | None,
    turns: Iterable[tuple[str, Sequence[BoolArray]]],
    components_g: FloatArray | None = None,
) -> tuple[HeldOutPoses, ...]:
    """Errors in the order of the turns as those of poses; masks are of the poses judged.

    `components_g` are rms errors of the components, in the same order.
    """
    found: list[HeldOutPoses] = []
    start = 0
    for what, masks in turns:
        if errors_g is None or not masks:
            continue
        poses = tuple(int(k) for mask in masks for k in np.flatnonzero(mask))
        own = slice(start, start + len(poses))
        of_components = None if components_g is None else components_g[own]
        found.append(HeldOutPoses(what, poses, errors_g[own], of_components))
        start += len(poses)
    return tuple(found)


@dataclass(frozen=True)
class HeldOutDwell:
    """A dwell at a temperature held out, and |a| - g there by curves fitted without it, in g."""

    row: int
    position: str
    temp_degc: float
    error_g: float


@dataclass(frozen=True)
class HeldOutTest:
    """What a tilter's readings outside the fit say of the chosen curves.

    Attributes
    ----------
    dwells : tuple of HeldOutDwell
        Six for each inner temperature, held out in turn; none with fewer than four temperatures.
    rms_g : float or None
        Rms error of a component of the force at them.
    function : str
        The function that was fitted without them.
    share : float
        The error of the delivered curves as a share of these errors: 1, or less where they pass
        all temperatures and those held out could only test a function of one parameter less.
    between : bool
        Whether anything tests the curves between the calibrated temperatures.
    """

    dwells: tuple[HeldOutDwell, ...]
    rms_g: float | None
    function: str
    share: float
    between: bool

    @property
    def worst(self) -> HeldOutDwell | None:
        """The dwell with the largest error."""
        return max(self.dwells, key=lambda d: abs(d.error_g), default=None)


@dataclass(frozen=True)
class OwnSquares:
    """Squares of the axes' own accelerations from six positions, and whether they go into the C.

    Attributes
    ----------
    per_g : array, shape (3,)
        Of x, y, z in g/g^2, as Q has them.
    sd_per_g, prior_per_g : float
        Standard deviation of each, and of its prior.
    data_share : float
        How much of each the readings determine; the rest is the prior.
    effect_g, matters_g : float
        The largest at 1 g, and what it has to exceed.
    chance : float
        Probability that squareness and noise alone make such squares.
    held_out_g, checks_g : tuple of two floats, or None
        Rms without and with the squares: of what shows them at temperatures held out, and of
        |a| - g at check dwells. None where there are none.
    asked : str
        [firmware] terms.
    untested : array, shape (3, 2)
        Whether no check dwell tells each from a wrong reading, as a saturated one, at + 1 g, and
        from one at - 1 g.
    """

    per_g: FloatArray
    sd_per_g: float
    prior_per_g: float
    data_share: float
    effect_g: float
    matters_g: float
    chance: float
    held_out_g: tuple[float, float] | None
    checks_g: tuple[float, float] | None
    asked: str
    untested: BoolArray

    @property
    def significant(self) -> bool:
        """Whether they matter, and are more than squareness and noise make."""
        return self.effect_g > self.matters_g and self.chance < CHANCE

    @property
    def included(self) -> bool:
        """Whether they go into the C."""
        if self.asked != AUTO:
            return self.asked != LINEAR
        judged = (j for j in (self.held_out_g, self.checks_g) if j is not None)
        return self.significant and all(having < without for without, having in judged)


@dataclass(frozen=True)
class RunRepeatability:
    """How far the constants of one run are from those of others, noise included.

    Attributes
    ----------
    runs : int
        Complete runs in the mean, at the temperature with the fewest.
    temperatures : int
        At which there were more than one.
    dof : int
        Degrees of freedom of each constant's standard deviation.
    bias_g, scale_ratio, cross_ratio : float
        Standard deviations of a bias in g, of a scale factor and of a cross term by the scale
        factor.
    """

    runs: int
    temperatures: int
    dof: int
    bias_g: float
    scale_ratio: float
    cross_ratio: float
