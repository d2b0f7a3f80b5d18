"""Scales of a sound unit's priors: how far its parts usually are from none."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cache

import numpy as np


@dataclass(frozen=True)
class Scales:
    """Standard deviations of the priors; the data choose them within priors of their own.

    Attributes
    ----------
    noise : float
        Of the readings, as a multiple of what is stated.
    tilt : float
        Of one placement, rad.
    seat : float
        Of a position at all temperatures (squareness and reproducible errors of the rig), rad.
    bias_curvature, curvature : float
        Of the curves of the biases and of the sensitivities, as multiples of those of a usual
        sensor. Biases that bend much say nothing of sensitivities.
    bend : float
        Of what no polynomial follows, g.
    """

    noise: float = 1.0
    tilt: float = 30e-6
    seat: float = 100e-6
    bias_curvature: float = 1.0
    curvature: float = 1.0
    bend: float = 0.0


_CURVATURES = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0), 1.5, 1.5
_CHOICES: dict[str, tuple[tuple[float, ...], float, float]] = {
    "noise": ((0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8), 1.0, 0.5),
    "tilt": ((4e-6, 10e-6, 20e-6, 40e-6, 80e-6, 160e-6), 30e-6, 0.8),
    "seat": ((15e-6, 40e-6, 80e-6, 160e-6), 80e-6, 0.6),  # 33": what is more is squareness
    "bias_curvature": _CURVATURES,
    "curvature": _CURVATURES,
    "bend": ((0.0, 50e-6, 100e-6, 200e-6), 70e-6, 0.8),
}
"""Values of each scale, and mean and standard deviation of its logarithm."""


@cache
def log_prior(scales: Scales) -> float:
    """Logarithm of what makes scales less probable than the usual ones; 0 for those.

    It is no density: of each hypothesis the scales are maximised, on these few values, and not
    integrated out as the noise of poses is (`fitting.core.noise`). So a hypothesis that
    needs particular scales pays for how unusual they are, and not for how narrow their choice is.
    Hypotheses that need equally narrow ones pay too little alike, and `MARGIN` holds between them;
    between others its odds of 20 to 1 are approximate. How often a sound unit is taken for a faulty
    one is therefore counted on simulated units (bench/diagnosis.py).
    """
    total = 0.0
    for name, (choices, middle, spread) in _CHOICES.items():
        if not choices[0] <= getattr(scales, name) <= choices[-1]:
            continue  # of a cause that is about this scale, and pays for it itself
        value = max(getattr(scales, name), 20e-6 if name == "bend" else 0.0)
        total -= 0.5 * (np.log(value / middle) / spread) ** 2
    return float(total)


def nearby(scales: Scales, name: str) -> list[Scales]:
    """The same with the next values of one scale."""
    values = _CHOICES[name][0]
    value = getattr(scales, name)
    at = int(np.argmin([abs(v - value) for v in values]))
    ks = [k for k in (at - 1, at + 1) if 0 <= k < len(values)]
    return [replace(scales, **{name: values[k]}) for k in ks]


SCALE_NAMES = tuple(f.name for f in fields(Scales))
