"""Shapes whose parameters are their values at knots, with one polynomial between neighbours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import Key
from triaxcal.base.kinds import rising
from triaxcal.model.curves import PiecewisePolynomial
from triaxcal.model.thermal.shape import (
    GROUP_GAP_DEGC,
    PLAUSIBLE_DEGC,
    Settings,
    ThermalShape,
    ends_of,
    listed,
)
from triaxcal.model.types import FloatArray, IntArray

KNOT_NOISE_MAX = 10.0
"""Of the points' noise, at a knot: above this, no temperature is near enough to determine it."""
KNOTS_KEY = "knots_degc"


def knots_key(default_words: str) -> Key[tuple[float, ...] | None]:
    """Key of the knots; the default differs between functions."""
    return Key(
        KNOTS_KEY,
        rising(*PLAUSIBLE_DEGC, 1, 64),
        "Temperatures where segments meet; the ends of the calibrated range are added.",
        None,
        "degC",
        default_words,
        example="[20.0]",
    )


@dataclass(frozen=True)
class KnottedShape(ThermalShape):
    """A function that its values at rising knots determine; end segments continue beyond."""

    title: ClassVar[str]

    knots_degc: tuple[float, ...]

    @classmethod
    def over(
        cls, temps_degc: FloatArray, t0_degc: float, knots_degc: Sequence[float] | None = None
    ) -> Self:
        """Shape over calibrated temperatures of shape (G,), two at least.

        Knots None are the lowest temperature, T0 and the highest. To chosen knots the lowest and
        highest temperature are added where no knot is within `GROUP_GAP_DEGC` of them: a group at
        T0 is nearly, not exactly, there.
        """
        low, high = ends_of(temps_degc)
        knots = sorted({t0_degc} if knots_degc is None else set(knots_degc))
        if knots[0] - low > GROUP_GAP_DEGC:
            knots.insert(0, low)
        if high - knots[-1] > GROUP_GAP_DEGC:
            knots.append(high)
        if len(knots) == 1:  # both ends are near the only knot: the farther one makes the segment
            knots = sorted([knots[0], low if knots[0] - low > high - knots[0] else high])
        return cls(t0_degc, (low, high), tuple(knots))

    @classmethod
    def through(cls, temps_degc: FloatArray, t0_degc: float) -> Self:
        """Shape with a knot at every calibrated temperature, T0 standing for the one at T0."""
        knots = [float(t) for t in temps_degc]
        knots[int(np.argmin(np.abs(temps_degc - t0_degc)))] = t0_degc
        return cls.over(temps_degc, t0_degc, knots)

    @property
    def parameters(self) -> int:
        return len(self.knots_degc)

    @property
    def detail(self) -> str:
        return f"{len(self.knots_degc)} knots"

    @property
    def label(self) -> str:
        return f"{self.title}, knots {', '.join(f'{k:.4g}' for k in self.knots_degc)} degC"

    @property
    def short_label(self) -> str:
        return f"{self.title}, {self.detail}"

    @property
    def settings(self) -> Settings:
        return {KNOTS_KEY: self.knots_degc}

    def segment_of(self, temp_degc: FloatArray) -> IntArray:
        """Index of the segment of each temperature."""
        inner = np.asarray(self.knots_degc[1:-1])
        return np.searchsorted(inner, temp_degc, side="right").astype(np.int64)

    def segments(self, from_knot: FloatArray, values: FloatArray) -> PiecewisePolynomial:
        """Segments of coefficients (12, segments, order + 1) that count from the lower knot.

        The origin becomes T0 in segments that touch or hold it, so that two of them are P1 (4).
        `values` (12, knots) are those at the knots.
        """
        knots = np.asarray(self.knots_degc)
        near = (knots[:-1] <= self.t0_degc) & (self.t0_degc <= knots[1:])
        origins = np.where(near, self.t0_degc, knots[:-1])
        shift, found = origins - knots[:-1], from_knot.copy()
        for first in range(from_knot.shape[2] - 1):  # Taylor shift, Horner's rule a coefficient
            for n in range(from_knot.shape[2] - 2, first - 1, -1):
                found[:, :, n] += shift * found[:, :, n + 1]
        # Exactly the knot's value where the origin is the upper knot: neighbours meet to the bit.
        found[:, :, 0] = np.where(origins == knots[1:], values[:, 1:], found[:, :, 0])
        return PiecewisePolynomial(
            self.knots_degc, tuple(float(o) for o in origins), np.moveaxis(found, 0, 1)
        )

    def without(self, remaining_degc: FloatArray, held_out_degc: float) -> Self:
        reduced = replace(self, ends_degc=ends_of(remaining_degc))
        while len(reduced.knots_degc) > 2 and reduced.undetermined_knot(remaining_degc) is not None:
            knots = list(reduced.knots_degc)
            knots.remove(min(knots[1:-1], key=lambda k: abs(k - held_out_degc)))
            reduced = replace(reduced, knots_degc=tuple(knots))
        return reduced

    def undetermined_knot(self, temps_degc: FloatArray) -> float | None:
        """Knot whose value the temperatures do not determine, the worst; None when all are.

        Unit noise of the points gives a knot the standard deviation |row of the basis' inverse|.
        """
        _, singular, vt = np.linalg.svd(self.basis(temps_degc), full_matrices=True)
        inverse = np.full(self.parameters, np.inf)
        inverse[: len(singular)] = 1.0 / np.maximum(singular, 1e-9)
        noise = np.linalg.norm(vt.T * np.minimum(inverse, 1e9), axis=1)
        worst = int(np.argmax(noise))
        return self.knots_degc[worst] if noise[worst] > KNOT_NOISE_MAX else None

    def undetermined(self, where: str, temps_degc: FloatArray) -> RefusedError | None:
        low, high = self.ends_degc
        gap = GROUP_GAP_DEGC
        outside = [k for k in self.knots_degc if not low - gap <= k <= high + gap]
        bad = outside[0] if outside else self.undetermined_knot(temps_degc)
        if bad is None:
            return None
        return RefusedError(
            f"{where}, [thermal] {KNOTS_KEY}",
            f"nothing determines the knot at {bad:.6g} degC: calibrated temperatures are "
            f"{listed(temps_degc)} degC",
            expected="a calibrated temperature near each knot",
            remedy="remove or move the knot, or measure there",
        )
