"""What |a| - g says of samples that were taken one after the other: something only at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.device.compare import Agreement, Samples

_BEYOND_NOISE = 3.0
"""Variance of samples at rest is that of their steps, halved; by chance at most this many times."""
_COVERAGE = 2.0


@dataclass(frozen=True)
class Allowed:
    """What |a| - g may be at rest.

    Attributes
    ----------
    limit_g : float
        Of the unit.
    calibration_g : float
        Expanded uncertainty (95 %) of |a| by the calibration.
    """

    limit_g: float
    calibration_g: float


def why_not_at_rest(samples: Samples, output_q: int, limit_g: float) -> str:
    """Why samples are not those of a unit at rest; "" where they are.

    Turning that scatters the force by s shortens its mean by s^2 / 2 (in g, to second order):
    beyond the limit nothing can be said of the length. Slow motion has steps that are small for its
    scatter (von Neumann's ratio); noise has not.
    """
    force_g = samples.accel * 2.0**-output_q
    variance = float(force_g.var(axis=0, ddof=1).sum())
    by_steps = float((np.diff(force_g, axis=0) ** 2).mean(axis=0).sum()) / 2.0
    slow = variance > max(limit_g**2, _BEYOND_NOISE * by_steps)
    if slow or variance / 2.0 > limit_g:
        return f"not at rest, the samples scatter by {1e3 * variance**0.5:.3g} mg"
    return ""


def judge_length(
    place: str, samples: Samples, found: Agreement, output_q: int, allowed: Allowed
) -> str:
    """Why |a| - g is not judged; "" where it is within what is allowed.

    Raises
    ------
    RefusedError
        When the unit rests and its |a| - g is beyond the limit and the uncertainty.
    """
    if found.flagged:
        return "a status is not 0"
    why = why_not_at_rest(samples, output_q, allowed.limit_g)
    if why:
        return why
    uncertainty_g = float(np.hypot(allowed.calibration_g, _COVERAGE * found.length_sd_g))
    if abs(found.length_error_g) > allowed.limit_g + uncertainty_g:
        raise RefusedError(
            place,
            f"not verified: |a| - g is {1e3 * found.length_error_g:+.3f} mg at rest, every bit of "
            f"the {found.samples} samples is that of the integer model",
            expected=f"at most {1e3 * allowed.limit_g:g} mg and its uncertainty, "
            f"{1e3 * uncertainty_g:.2g} mg",
            remedy="these constants are not this sensor's, the sensor has changed, or the local "
            "gravity is another (--gravity)",
        )
    return ""
