"""Power spectral density of a signal at rest, averaged in bins of equal ratio.

One sine taper, w_t = sqrt(2 / (n + 1)) sin(pi t / (n + 1)) (K. S. Riedel, A. Sidorenko, minimum
bias multiple taper spectral estimation, 10.1109/78.365298): its side lobes fall as f^-4, so that a
random walk, f^-2, does not leak. Densities are two-sided, as IEEE 952 has them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.model.types import FloatArray

FIRST = 2
"""First ordinate used: the one below is what the mean has taken off."""
CORRELATED = 1.5
"""Variance of a mean over ordinates beside that of as many independent ones: neighbours have the
correlation 1/4, the square of sum w^2 exp(2 pi i t / n) = 1/2."""
_BINS_AN_OCTAVE = 6.0
_KERNEL = 0.25
"""Variance of the taper's kernel, in ordinates squared: sum (w')^2 / (2 pi / n)^2."""


@dataclass(frozen=True)
class Spectrum:
    """Mean density in bins of frequency.

    Attributes
    ----------
    step_s : float
        Time between samples.
    ordinate : array, shape (ordinates,)
        Number of each ordinate: its frequency is number / (n step).
    start : array of int, shape (bins,)
        First ordinate of each bin.
    count : array, shape (bins,)
        Ordinates in each.
    density : array, shape (bins,)
        Unit of the signal squared, by Hz.
    samples : int
    """

    step_s: float
    ordinate: FloatArray
    start: FloatArray
    count: FloatArray
    density: FloatArray
    samples: int

    def mean(self, values: FloatArray) -> FloatArray:
        """Means (bins,) of values at the ordinates."""
        result: FloatArray = np.add.reduceat(values, self.start.astype(np.intp)) / self.count
        return result

    def shape(self, power: int) -> FloatArray:
        """Mean of |2 sin(pi f dt) / dt|^power in each bin, as the taper shows it.

        The discrete counterpart of (2 pi f)^power: exact for sums and differences of samples.
        """
        f = self.ordinate / self.samples
        exact = np.abs(2.0 * np.sin(np.pi * f) / self.step_s) ** power
        # A kernel of variance v widens f^p to f^p (1 + v p (p - 1) / 2 / j^2).
        wide = 1.0 + _KERNEL * power * (power - 1) / 2.0 / self.ordinate**2
        return self.mean(exact * wide)


def spectrum(signal: FloatArray, step_s: float) -> Spectrum:
    """Density of a signal, shape (n,), n at least 16."""
    n = len(signal)
    w = np.sqrt(2.0 / (n + 1)) * np.sin(np.pi * np.arange(1, n + 1) / (n + 1))
    free = signal - (w @ signal) / w.sum()
    power = step_s * np.abs(np.fft.rfft(w * free)) ** 2
    last = (n - 1) // 2
    ordinate = np.arange(FIRST, last + 1, dtype=np.float64)
    octave = np.floor(np.log2(ordinate) * _BINS_AN_OCTAVE)
    first = np.flatnonzero(np.diff(octave, prepend=-1.0))
    count = np.diff(first, append=len(ordinate)).astype(np.float64)
    start = first.astype(np.float64)
    found = Spectrum(step_s, ordinate, start, count, np.empty(0), n)
    density = found.mean(power[FIRST : last + 1])
    return Spectrum(step_s, ordinate, start, count, density, n)
