"""Overlapping Allan deviation with its 95 % interval, by the optional package allantools.

Degrees of freedom by C. Greenhall and W. Riley (Uncertainty of stability variances based on finite
differences), for the noise that dominates at each averaging time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import gammaincinv

from triaxcal.base.extras import refuse_missing_packages
from triaxcal.model.types import FloatArray
from triaxcal.noise.coefficients import Coefficient, allan_variance

CLUSTERS_MIN = 9
"""At the longest averaging time: its Allan deviation is then known to about 25 %."""
FLICKER = 0.6643
"""sqrt(2 ln 2 / pi): Allan deviation of a bias instability of 1."""
_ALPHA = {"Q": 2, "N": 0, "B": -1, "K": -2, "R": -2}
"""Power of f in the density of fractional frequency; allantools has no -3."""
_AN_OCTAVE = 2


@dataclass(frozen=True)
class AllanCurve:
    """Allan deviation of a signal.

    Attributes
    ----------
    tau_s, deviation, low, high : arrays, shape (n,)
        Averaging time; deviation and its 95 % interval, in the unit of the signal.
    """

    tau_s: FloatArray
    deviation: FloatArray
    low: FloatArray
    high: FloatArray

    @property
    def floor(self) -> int:
        """Where it is lowest."""
        return int(np.argmin(self.deviation))


def allan_curve(signal: FloatArray, step_s: float, found: Sequence[Coefficient]) -> AllanCurve:
    """Allan deviation of a signal (n,) whose coefficients have been found.

    Raises
    ------
    RefusedError
        Where allantools is missing.
    """
    refuse_missing_packages("Allan deviation", ["allantools"], "noise")
    import allantools  # noqa: PLC0415  optional, and slow to import

    n = len(signal)
    octaves = np.arange(0.0, np.log2(max(n // CLUSTERS_MIN, 1)) + 1e-9, 1.0 / _AN_OCTAVE)
    m = np.unique(np.round(2.0**octaves).astype(np.int64))
    tau, deviation, _, _ = allantools.oadev(
        signal, rate=1.0 / step_s, data_type="freq", taus=m * step_s
    )
    m = np.round(np.asarray(tau) / step_s).astype(np.int64)
    parts = np.stack([c.value**2 * allan_variance(c.kind, np.asarray(tau)) for c in found])
    kinds = [found[k].kind.symbol for k in parts.argmax(axis=0)]
    dof = np.array(
        [
            allantools.edf_greenhall(_ALPHA[kind], 2, int(k), n + 1, overlapping=True)
            for kind, k in zip(kinds, m, strict=True)
        ]
    )
    low, high = (  # chi^2
        deviation * np.sqrt(dof / (2.0 * gammaincinv(dof / 2.0, p))) for p in (0.975, 0.025)
    )
    return AllanCurve(np.asarray(tau), np.asarray(deviation), np.asarray(low), np.asarray(high))
