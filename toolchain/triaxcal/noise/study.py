"""Noise of the three outputs of a recording at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray
from triaxcal.noise.allan import CLUSTERS_MIN, AllanCurve, allan_curve
from triaxcal.noise.coefficients import Coefficient, coefficients
from triaxcal.noise.spectrum import spectrum

_JUMP = 8.0
"""Of a Gaussian, one step in 10^15 is so large."""


@dataclass(frozen=True)
class AxisNoise:
    """Noise of one output.

    Attributes
    ----------
    axis : str
    coefficients : tuple of Coefficient
        In the order of `noise.coefficients.KINDS`.
    allan : AllanCurve or None
        None where allantools is missing.
    """

    axis: str
    coefficients: tuple[Coefficient, ...]
    allan: AllanCurve | None

    def of(self, symbol: str) -> Coefficient:
        """Coefficient of a symbol: Q, N, B, K or R."""
        return next(c for c in self.coefficients if c.kind.symbol == symbol)


@dataclass(frozen=True)
class NoiseStudy:
    """Noise of a recording at rest.

    Attributes
    ----------
    source : str
    axes : tuple of three AxisNoise
    step_s, duration_s : float
    findings : tuple of str
        What was left out, and why there is no Allan deviation.
    trusted : bool
        No output jumps as no noise does.
    """

    source: str
    axes: tuple[AxisNoise, ...]
    step_s: float
    duration_s: float
    findings: tuple[str, ...] = ()
    trusted: bool = True

    @property
    def longest_tau_s(self) -> float:
        """Longest averaging time that the recording allows."""
        return self.duration_s / CLUSTERS_MIN


def study_noise(
    source: str, signal: FloatArray, step_s: float, longest_tau_s: float | None = None
) -> NoiseStudy:
    """Coefficients and Allan deviation of a signal at rest, shape (n, 3), evenly sampled.

    Raises
    ------
    RefusedError
        When the signal is too short for the averaging time that is asked for, or does not change.
    """
    duration = len(signal) * step_s
    if longest_tau_s is not None and duration < CLUSTERS_MIN * longest_tau_s:
        raise RefusedError(
            source,
            f"{duration:.4g} s long",
            expected=f"{CLUSTERS_MIN * longest_tau_s:.4g} s for an averaging time of "
            f"{longest_tau_s:.4g} s: {CLUSTERS_MIN} stretches of it",
            remedy=f"record longer, or ask for {duration / CLUSTERS_MIN:.3g} s",
        )
    for k, axis in enumerate(AXES):
        if signal[:, k].min() == signal[:, k].max():
            raise RefusedError(
                source,
                f"output {axis} has the same value throughout",
                expected="noise",
                remedy="record it with more digits, or check the column",
            )
    axes, findings = [], []
    for k, axis in enumerate(AXES):
        found = coefficients(spectrum(signal[:, k], step_s))
        curve = None
        try:
            curve = allan_curve(signal[:, k], step_s, found)
        except RefusedError as missing:
            findings = [str(missing)]
        axes.append(AxisNoise(axis, found, curve))
    jumps = _jumps(signal)
    return NoiseStudy(source, tuple(axes), step_s, duration, (*jumps, *findings), not jumps)


def _jumps(signal: FloatArray) -> list[str]:
    """Steps from one sample to the next that no noise makes."""
    found = []
    for k, axis in enumerate(AXES):
        steps = np.abs(np.diff(signal[:, k]))
        # The median of |step| is 0.6745 of its standard deviation; 0 where most repeat a code.
        limit = _JUMP * float(np.median(steps)) / 0.6745
        count = int((steps > limit).sum()) if limit else 0
        if count:
            first = int(np.argmax(steps > limit)) + 1
            found.append(
                f"output {axis} jumps by more than {_JUMP:g} standard deviations, {count} in all, "
                f"first after sample {first} of the stretch: no noise does that, and the "
                "coefficients are not to be trusted"
            )
    return found
