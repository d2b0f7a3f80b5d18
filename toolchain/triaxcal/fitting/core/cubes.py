"""The cubes of the outputs' own accelerations, K3, as the residuals of a fit without them show.

    U_i = K_ii (a_i + K3_i a_i^3) + ...

The C has no such term. At |a| = g a scale factor takes up most of a cube, so what a calibration
leaves is small; theory.md has the numbers. With residuals r = C k + J d + noise of variance s^2,
d ~ N(0, V0) the constants and V their covariance with the readings known,

    k = A^-1 C^T r / s^2,    A = C^T (C - J V J^T C / s^2) / s^2

is the estimate of all K3 and all constants together, without another fit: at the most probable
constants (s^2 + J V0 J^T)^-1 of the readings is r / s^2.

A fit that knows K3 as well has a smaller sum of squares, of which the prior's is a part: it falls
by k^T A k s^2 from |r|^2 + s^2 |z|^2, with z the constants' distance from d = 0 in standard
deviations of V0. Of n readings and constants as large as V0 says, what is left is s^2 chi^2 of
n - k degrees of freedom; of constants that are much smaller, of n - k less those that the readings
determine. The latter is taken: noise then makes a finding no more often than it says, whatever the
constants are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.fitting.core.outliers import CHANCE, fisher_tail
from triaxcal.model.types import FloatArray

_LEFT_MAX = 0.4
"""Of K3: largest |a^3 - a| for |a| <= 1, 2 / sqrt(27), and as much where a scale takes it up."""
_ROUNDING_G = 1e-12
_SEEN_MIN = 1e-3
"""Of the cubes' length: what the constants leave of them, or poses do not show them."""


@dataclass(frozen=True)
class Cubes:
    """K3 of some axes.

    Attributes
    ----------
    axes : str
        Which of x, y, z.
    per_g2, sd_per_g2 : arrays, shape (k,)
        Of 1 g in a reading, for 1 g^3.
    chance : float
        That noise makes as much of them.
    """

    axes: str
    per_g2: FloatArray
    sd_per_g2: FloatArray
    chance: float


def cubes_of(
    axes: str,
    residual: FloatArray,
    columns: FloatArray,
    absorbed: FloatArray,
    dof: float,
    *,
    prior_squares: float = 0.0,
) -> Cubes | None:
    """K3 from residuals.

    Parameters
    ----------
    residual : array, shape (n,)
        Weighted, g.
    columns, absorbed : arrays, shape (n, k)
        C, and J V J^T C / s^2: what the constants take up of it.
    dof : float
        Degrees of freedom of the residuals.
    prior_squares : float
        s^2 |z|^2 of a fit with priors, g^2.

    Returns
    -------
    Cubes or None
        None where the poses do not show them beside the constants.
    """
    left = columns.T @ (columns - absorbed)
    least = float(np.linalg.eigvalsh((left + left.T) / 2.0)[0])
    count = len(axes)
    if dof < count + 2 or least < _SEEN_MIN**2 * float((columns**2).sum()):
        return None
    found = np.linalg.solve(left, columns.T @ residual)
    explained = float(found @ left @ found)
    squares = float(residual @ residual) + prior_squares
    variance = max(squares - explained, _ROUNDING_G**2) / (dof - count)
    ratio = explained / count / variance
    return Cubes(
        axes,
        np.asarray(found, dtype=np.float64),
        np.asarray(np.sqrt(variance * np.diag(np.linalg.inv(left))), dtype=np.float64),
        fisher_tail(count, round(dof) - count, ratio) if ratio > 1.0 else 1.0,
    )


def cube_findings(found: list[Cubes | None]) -> list[str]:
    """What residuals show of cubes, where noise does not explain it; tested as often as `found`."""
    seen = [c for c in found if c is not None and c.chance * len(found) < CHANCE]
    if not seen:
        return []
    values = ", ".join(
        f"{axis} {k * 1e6:.3g} ± {sd * 1e6:.2g}"
        for c in seen
        for axis, k, sd in zip(c.axes, c.per_g2, c.sd_per_g2, strict=True)
    )
    largest = max(float(np.abs(c.per_g2).max()) for c in seen)
    words = (
        "the residuals bend as the cube of an output's own acceleration does, or its odd square: "
        f"K3 {values} micro-g/g^3; the C has no such term, which leaves up to "
        f"{_LEFT_MAX * largest * 1e6:.2g} micro-g at 1 g and grows with the cube above"
    )
    return [words]
