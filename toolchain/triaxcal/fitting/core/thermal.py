"""Thermal functions to fit: P1 (3) polynomial, P1 (4) piecewise-linear made continuous.

A shape is a basis of P functions of temperature; each of the twelve constants is a sum of them.

polynomial        x^n, n = 0..order, x = (T - T0) / s, s the farthest calibrated |T - T0|: powers
                  of degC span many decades, powers of x do not. With order = temperatures - 1
                  the curve passes all points and is that of P1 (11); the constant term is free,
                  so with more temperatures it need not pass the point at T0.
piecewise-linear  one hat a knot, 1 there and 0 at its neighbours; the end segments continue
                  beyond the end knots. Knots at the lowest temperature, T0 and the highest give
                  the two segments of P1 (12).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.grouping import GROUP_GAP_DEGC
from triaxcal.model.metrological import BIASES
from triaxcal.model.thermal import PiecewisePolynomial, ThermalModel
from triaxcal.model.types import FloatArray

POLYNOMIAL = "polynomial"
PIECEWISE_LINEAR = "piecewise-linear"
KNOT_NOISE_MAX = 10.0
"""Of the points' noise, at a knot: above this, no temperature is near enough to determine it."""
EDGE_DEGC = 0.5
"""How far beyond the calibrated temperatures curves may be used."""


@dataclass(frozen=True)
class ThermalShape:
    """A basis of functions of temperature.

    Attributes
    ----------
    kind : str
        "polynomial" or "piecewise-linear".
    t0_degc : float
        Reference temperature.
    ends_degc : tuple of two floats
        Lowest and highest calibrated temperature.
    order : int
        Order of the polynomials; 1 when piecewise-linear.
    knots_degc : tuple of float
        Rising; empty for "polynomial".
    """

    kind: str
    t0_degc: float
    ends_degc: tuple[float, float]
    order: int
    knots_degc: tuple[float, ...] = ()

    @property
    def parameters(self) -> int:
        """P: parameters of each constant's curve."""
        return len(self.knots_degc) if self.kind == PIECEWISE_LINEAR else self.order + 1

    @property
    def label(self) -> str:
        """Words for tables and messages."""
        if self.kind == PIECEWISE_LINEAR:
            return f"piecewise-linear, knots {', '.join(f'{k:.4g}' for k in self.knots_degc)} degC"
        return f"polynomial of order {self.order}"

    @property
    def scale_degc(self) -> float:
        """Temperature difference that stands for 1 in the polynomials."""
        return max(abs(end - self.t0_degc) for end in self.ends_degc) or 1.0

    def basis(self, temp_degc: FloatArray | float) -> FloatArray:
        """Values of the P functions, shape (..., P), at temperatures of shape (...)."""
        temp = np.asarray(temp_degc, dtype=np.float64)
        if self.kind == POLYNOMIAL:
            x = (temp - self.t0_degc) / self.scale_degc
            powers: FloatArray = x[..., None] ** np.arange(self.order + 1)
            return powers
        knots = np.asarray(self.knots_degc)
        segment = np.searchsorted(knots[1:-1], temp, side="right")
        upper = (temp - knots[segment]) / (knots[segment + 1] - knots[segment])
        index = np.arange(len(knots))
        return np.where(index == segment[..., None], 1.0 - upper[..., None], 0.0) + np.where(
            index == segment[..., None] + 1, upper[..., None], 0.0
        )

    def model(self, parameters: FloatArray) -> ThermalModel:
        """Thermal model of parameters of shape (12, P)."""
        if self.kind == PIECEWISE_LINEAR:
            curves = self._segments(parameters)
        else:
            low, high = self.ends_degc
            # One temperature alone still makes a segment.
            breaks = (low, high) if low < high else (low - EDGE_DEGC, high + EDGE_DEGC)
            coefficients = parameters / self.scale_degc ** np.arange(self.order + 1)
            curves = PiecewisePolynomial(breaks, (self.t0_degc,), coefficients[None])
        return ThermalModel(self.kind, self.t0_degc, curves)

    def _segments(self, values: FloatArray) -> PiecewisePolynomial:
        """Straight segments between values of shape (12, knots).

        The origin is T0 in segments that touch or hold it, so that two of them are P1 (4), and
        the lower knot elsewhere.
        """
        knots = np.asarray(self.knots_degc)
        slopes = np.diff(values, axis=1) / np.diff(knots)
        near = (knots[:-1] <= self.t0_degc) & (self.t0_degc <= knots[1:])
        origins = np.where(near, self.t0_degc, knots[:-1])
        start = values[:, :-1] + slopes * (origins - knots[:-1])
        # Exactly the knot's value where the origin is the upper knot: neighbours meet to the bit.
        start = np.where(origins == knots[1:], values[:, 1:], start)
        coefficients = np.moveaxis(np.stack([start, slopes], axis=-1), 0, 1)
        return PiecewisePolynomial(self.knots_degc, tuple(float(o) for o in origins), coefficients)


def polynomial_shape(temps_degc: FloatArray, t0_degc: float, order: int) -> ThermalShape:
    """Polynomial of an order over calibrated temperatures of shape (G,)."""
    return ThermalShape(POLYNOMIAL, t0_degc, _ends(temps_degc), order)


def piecewise_linear_shape(
    temps_degc: FloatArray, t0_degc: float, knots_degc: Sequence[float] | None
) -> ThermalShape:
    """Continuous piecewise-linear function over calibrated temperatures of shape (G,).

    Knots None are the lowest temperature, T0 and the highest. To chosen knots the lowest and
    highest temperature are added where no knot is within `GROUP_GAP_DEGC` of them: a group at T0
    is nearly, not exactly, there. Needs at least two temperatures.
    """
    low, high = _ends(temps_degc)
    knots = sorted({t0_degc} if knots_degc is None else set(knots_degc))
    if knots[0] - low > GROUP_GAP_DEGC:
        knots.insert(0, low)
    if high - knots[-1] > GROUP_GAP_DEGC:
        knots.append(high)
    if len(knots) == 1:  # both ends are near the only knot: the farther one makes the segment
        knots = sorted([knots[0], low if knots[0] - low > high - knots[0] else high])
    return ThermalShape(PIECEWISE_LINEAR, t0_degc, (low, high), 1, tuple(knots))


def dense_knots(temps_degc: FloatArray, t0_degc: float) -> tuple[float, ...]:
    """Every calibrated temperature, T0 standing for the one at T0."""
    knots = [float(t) for t in temps_degc]
    knots[int(np.argmin(np.abs(temps_degc - t0_degc)))] = t0_degc
    return tuple(knots)


def undetermined_knot(shape: ThermalShape, temps_degc: FloatArray) -> float | None:
    """Knot whose value the temperatures do not determine, the worst; None when all are.

    Unit noise of the points gives a knot the standard deviation |row of the basis' inverse|.
    """
    basis = shape.basis(temps_degc)
    _, singular, vt = np.linalg.svd(basis, full_matrices=True)
    inverse = np.full(shape.parameters, np.inf)
    inverse[: len(singular)] = 1.0 / np.maximum(singular, 1e-9)
    inverse = np.minimum(inverse, 1e9)
    noise = np.linalg.norm(vt.T * inverse, axis=1)
    worst = int(np.argmax(noise))
    return shape.knots_degc[worst] if noise[worst] > KNOT_NOISE_MAX else None


def without_temperature(
    shape: ThermalShape, remaining_degc: FloatArray, left_out_degc: float
) -> ThermalShape:
    """The same shape where one calibrated temperature is left out.

    What the remaining temperatures no longer determine is dropped: an order, or the inner knot
    nearest the temperature left out.
    """
    ends = _ends(remaining_degc)
    if shape.kind == POLYNOMIAL:
        order = min(shape.order, len(remaining_degc) - 1)
        return ThermalShape(POLYNOMIAL, shape.t0_degc, shape.ends_degc, order)
    knots = list(shape.knots_degc)
    while True:
        reduced = ThermalShape(PIECEWISE_LINEAR, shape.t0_degc, ends, 1, tuple(knots))
        if len(knots) == 2 or undetermined_knot(reduced, remaining_degc) is None:
            return reduced
        knots.remove(min(knots[1:-1], key=lambda k: abs(k - left_out_degc)))


def refuse_undetermined(where: str, shape: ThermalShape, temps_degc: FloatArray) -> None:
    """Refuse a shape that the calibrated temperatures do not determine.

    Raises
    ------
    RefusedError
        Telling how many temperatures there are and what is needed, or which knot lacks data.
    """
    count = len(temps_degc)
    found = ", ".join(f"{t:.6g}" for t in temps_degc)
    if shape.kind == POLYNOMIAL:
        if shape.order >= count:
            raise RefusedError(
                f"{where}, [thermal] order",
                f"order {shape.order} with {count} calibrated temperature"
                f"{'s' if count != 1 else ''} ({found} degC)",
                expected=f"{shape.order + 1} temperatures for this order",
                remedy=f"the highest order possible is {count - 1}",
            )
        return
    low, high = shape.ends_degc
    outside = [
        k for k in shape.knots_degc if not low - GROUP_GAP_DEGC <= k <= high + GROUP_GAP_DEGC
    ]
    bad = outside[0] if outside else undetermined_knot(shape, temps_degc)
    if bad is not None:
        raise RefusedError(
            f"{where}, [thermal] knots_degc",
            f"nothing determines the knot at {bad:.6g} degC: calibrated temperatures are "
            f"{found} degC",
            expected="a calibrated temperature near each knot",
            remedy="remove or move the knot, or measure there",
        )


def relative_coefficients(model: ThermalModel) -> FloatArray:
    """Coefficients alpha, beta, gamma of P1 (3), (4), shape (segments, 12, order).

    Those of K are divided by the constant's value at T0 (P1 (11) lacks this division in print),
    1/degC^n; those of U0 (alpha) are V/degC^n. In a segment that does not touch T0 they belong
    to the segment's own origin. NaN where a constant of K is zero at T0: it has no relative form.
    """
    relative = model.curves.coefficients[:, :, 1:].copy()
    at_t0 = model.constants_at(model.t0_degc)
    divisor = np.where(np.isin(np.arange(12), BIASES), 1.0, at_t0)[:, None]
    result: FloatArray = np.divide(
        relative, divisor, out=np.full_like(relative, np.nan), where=divisor != 0.0
    )
    return result


def _ends(temps_degc: FloatArray) -> tuple[float, float]:
    return float(temps_degc.min()), float(temps_degc.max())
