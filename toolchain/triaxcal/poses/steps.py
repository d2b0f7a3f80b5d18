"""The steps in which readings are written, and what is left of them in the mean of a pose.

A converter, or a bus that scales its codes, gives multiples of one step. Noise of half a step and
more averages the rounding away. With less, the mean of a pose keeps an error that no longer pose
removes: with noise of standard deviation s and steps of q, over all places between two codes,

    variance = q^2 sum_n exp(-4 pi^2 n^2 s^2 / q^2) / (2 pi^2 n^2),

the Fourier series of the rounding error under normal noise (Widrow and Kollar, Quantization Noise,
2008, chapter 4). It is q^2 / 12 without noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.model.types import BoolArray, FloatArray
from triaxcal.readings.samples import READING, Samples
from triaxcal.unit.recording import RecordingLayout

_ALIKE = 0.1
"""Of a step: how far differences of readings may be from whole steps, for rounded decimals."""
_NEAR = 50
"""Steps: longer differences say nothing, because their own step is not known well enough."""
_LIMITS = 0.7
"""Of the uncertainty of a mean: half of its variance."""
_TERMS = np.arange(1, 13)
_LADDER = np.linspace(0.0, 1.0, 401)
"""Noise, of a step."""


@dataclass(frozen=True)
class Steps:
    """Steps of the three readings, in their unit; 0 where there are none.

    Attributes
    ----------
    size : array, shape (3,)
    whole : bool
        Whether all readings are whole numbers.
    """

    size: FloatArray
    whole: bool = False

    @staticmethod
    def of(samples: Samples) -> Steps:
        """Steps of the readings of a recording."""
        readings = samples.cut(np.concatenate(samples.table.spool.stretches()), READING)
        whole = bool((readings == np.rint(readings)).all())
        return Steps(np.array([_step(column) for column in readings.T.copy()]), whole)

    @property
    def motion(self) -> float:
        """Change of a mean that a reading on the edge between two codes shows without moving."""
        return 0.5 * float(np.sqrt(np.mean(self.size**2)))

    def coarse(self, scatter: FloatArray) -> BoolArray:
        """Axes, (3,), on which most poses show less noise than half a step; of scatter (n, 3)."""
        if not len(scatter):
            return np.zeros(3, dtype=np.bool_)
        result: BoolArray = np.median(scatter, axis=0) < 0.5 * self.size
        return result

    def sd_of_mean(self, scatter: FloatArray) -> FloatArray:
        """What rounding leaves in the mean of each pose, (n, 3), from their scatter, (n, 3).

        The scatter of one pose does not show its noise: within a code it is 0, on the edge of two
        it is half a step. The mean over all poses does.
        """
        found = np.zeros_like(scatter)
        for axis in np.flatnonzero(self.size > 0.0):
            q = self.size[axis]
            # Poses that shake have averaged their own rounding; they say nothing of the others.
            seen = float(np.mean(np.minimum(scatter[:, axis] / q, 0.5) ** 2))
            noise = float(np.interp(seen, _SCATTER, _LADDER))
            own = np.where(scatter[:, axis] > q, 1.0, noise)
            found[:, axis] = q * np.sqrt(_rounding(own))
        return found

    def finding(
        self, left: FloatArray, sd_mean: FloatArray, layout: RecordingLayout, one_g: float
    ) -> tuple[str, ...]:
        """Sentence where steps, and not noise, limit most poses; `left` is part of `sd_mean`."""
        limits = np.median(left, axis=0) > _LIMITS * np.median(sd_mean, axis=0)
        if not limits.any():
            return ()
        axis = int(np.where(limits, self.size, 0.0).argmax())
        mg = 1e3 / one_g
        sentence = (
            f"the readings have steps of {self.size[axis]:.4g} {layout.acceleration_unit} "
            f"({self.size[axis] * mg:.3g} mg), coarser than their noise: they limit the mean of a "
            f"pose to about {np.median(left[:, axis]) * mg:.2g} mg, however long it is; more poses "
            "help, each in another orientation, or readings with more digits"
        )
        return (sentence,)


def _step(values: FloatArray) -> float:
    """Step of which all differences of values are whole multiples; 0 without one."""
    levels = np.unique(values)
    apart = np.diff(levels)
    apart = apart[apart > 1e-9 * float(np.abs(levels).max())]
    if not len(apart):
        return 0.0
    step = float(apart.min())
    near = apart[apart < _NEAR * step]
    step = float(near.sum() / np.round(near / step).sum())
    multiples = near / step
    return step if np.abs(multiples - np.round(multiples)).max() < _ALIKE else 0.0


def _rounding(noise: FloatArray) -> FloatArray:
    """Variance of the error of a mean by rounding, in steps^2, for noise in steps."""
    squared = (np.asarray(noise)[..., None] * _TERMS) ** 2
    result: FloatArray = (np.exp(-4.0 * np.pi**2 * squared) / (2.0 * np.pi**2 * _TERMS**2)).sum(-1)
    return result


_SCATTER = np.maximum.accumulate(_LADDER**2 + _rounding(np.zeros(1))[0] - _rounding(_LADDER))
"""Variance within poses that rounded readings show, in steps^2, rising with the noise."""
