"""Functions of time with their first and second derivatives, exact between breaks.

A jet is an array of shape (3, n): value, first and second derivative at n times.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from triaxcal.model.types import FloatArray

_STEP = (0.0, 0.0, 0.0, 10.0, -15.0, 6.0)
"""10 u^3 - 15 u^4 + 6 u^5: from 0 to 1 with two zero derivatives at both ends."""
_RAMP = (0.0, 0.0, 0.0, 0.0, 2.5, -3.0, 1.0)
"""Its integral."""


@dataclass(frozen=True)
class PiecewiseMotion:
    """A polynomial of time between breaks, at rest before the first and after the last.

    Attributes
    ----------
    breaks_s : array, shape (m,)
        Where each piece begins; the first at minus infinity.
    coefficients : array, shape (m, 7)
        Of powers 0 to 6 of the time since the break.
    """

    breaks_s: FloatArray
    coefficients: FloatArray

    @classmethod
    def resting(cls, value: float = 0.0) -> PiecewiseMotion:
        """Constant at all times."""
        return cls(np.array([-math.inf]), np.array([[value, *[0.0] * 6]]))

    def then(
        self, start_s: float, spans_s: tuple[float, ...], polynomials: tuple[tuple[float, ...], ...]
    ) -> PiecewiseMotion:
        """The same, and from `start_s` on these pieces, after which it rests again.

        The pieces are changes against the value before; each begins where the one before ends.
        """
        breaks, rows = list(self.breaks_s), list(self.coefficients)
        value, time_s = float(rows[-1][0]), start_s
        for span, polynomial in zip(spans_s, polynomials, strict=True):
            row = np.zeros(7)
            row[: len(polynomial)] = polynomial
            row[0] = value
            breaks.append(time_s)
            rows.append(row)
            value += sum(c * span**n for n, c in enumerate(polynomial) if n)
            time_s += span
        breaks.append(time_s)
        rows.append(np.array([value, *[0.0] * 6]))
        return PiecewiseMotion(np.array(breaks), np.array(rows))

    def jet(self, time_s: FloatArray) -> FloatArray:
        """Value and two derivatives at times (n,), shape (3, n)."""
        piece = np.searchsorted(self.breaks_s, time_s, side="right") - 1
        result = np.zeros((3, len(time_s)))
        lowest, highest = int(piece.min()), int(piece.max())
        for k in range(lowest, highest + 1):
            inside = slice(None) if lowest == highest else piece == k
            rows = self.coefficients[k]
            if not rows[1:].any():
                result[0, inside] = rows[0]
                continue
            since = time_s[inside] - self.breaks_s[k]
            for order in range(3):
                result[order, inside] = np.polynomial.polynomial.polyval(
                    since, np.polynomial.polynomial.polyder(rows, order)
                )
        return result


Pieces = tuple[tuple[float, ...], tuple[tuple[float, ...], ...]]


def smooth_step(change: float, span_s: float) -> Pieces:
    """From rest to rest by `change` in `span_s`, with two derivatives zero at both ends."""
    return (span_s,), (tuple(change * c / span_s**n for n, c in enumerate(_STEP)),)


def smooth_move(angle: float, rate: float, ramp_s: float) -> Pieces:
    """From rest to a constant rate and to rest again: three derivatives are continuous.

    The rate rises and falls by `smooth_step` in `ramp_s` each.

    Raises
    ------
    ValueError
        When the angle is too small for the rate to be reached.
    """
    if abs(angle) < rate * ramp_s:
        raise ValueError(f"a turn by {angle:g} does not reach the rate {rate:g} in {ramp_s:g} s")
    signed = math.copysign(rate, angle)
    up = tuple(signed * ramp_s * c / ramp_s**n for n, c in enumerate(_RAMP))
    down = tuple(-c for c in up)
    held_s = abs(angle) / rate - ramp_s
    return (ramp_s, held_s, ramp_s), (up, (0.0, signed), (down[0], signed, *down[2:]))
