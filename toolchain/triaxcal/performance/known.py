"""A calibration with its uncertainty at the ends of the range and at T0, as the chapters use it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from triaxcal.fitting.core.calibration import Calibration
from triaxcal.model.metrological import unpack_constants
from triaxcal.model.types import FloatArray
from triaxcal.readings.measurements import MeasurementSet
from triaxcal.uncertainty.coverage import coverage_factor, effective_dof
from triaxcal.uncertainty.evaluate import Uncertainty, uncertainty
from triaxcal.uncertainty.propagation import ROWS
from triaxcal.unit.description import UnitDescription

_BETWEEN = 13
_COMMON = frozenset({"squareness", "level", "gravity", "thermometer", "own_squares"})
"""Sources whose error is the same at all temperatures: of a difference they leave at most as much
as independent errors do. All others may add up."""
_NOISE = "noise"


@dataclass(frozen=True)
class Known:
    """A calibration as the chapters use it.

    Attributes
    ----------
    unit : UnitDescription
    calibration : Calibration
    u : Uncertainty
        At `temps_degc`.
    """

    unit: UnitDescription
    calibration: Calibration
    u: Uncertainty

    @property
    def temps_degc(self) -> FloatArray:
        """Temperatures over the working range, its ends and T0 among them, shape (n,)."""
        return self.u.temps_degc

    @property
    def t0(self) -> int:
        """Index of T0 in `temps_degc`."""
        return self.u.t0_index

    def constants(self) -> FloatArray:
        """Twelve constants at `temps_degc`, shape (n, 12)."""
        return self.calibration.thermal.constants_at(self.temps_degc)

    def expanded(self, slopes: FloatArray, temp: int) -> float:
        """Expanded uncertainty of a function of the constants at one temperature, slopes (12,)."""
        kept = np.arange(len(self.temps_degc)) == temp
        return float(self.u.of_constants(slopes[None, None], kept)[0, 0])

    def expanded_difference(self, first: FloatArray, second: FloatArray, a: int, b: int) -> float:
        """Upper limit of the expanded uncertainty of first . c(T_a) + second . c(T_b).

        Noise by the covariance of the curves' parameters, a tilter's; sources of one error at all
        temperatures as if independent; all others as if they added up.
        """
        order, each = np.array(ROWS), []
        for s in self.u.sources:
            if s.constants is None:
                continue
            parts = [
                math.sqrt(max(float(g @ s.constants[k][np.ix_(order, order)] @ g), 0.0))
                for g, k in ((first, a), (second, b))
            ]
            if s.key == _NOISE and self.calibration.recording is None:
                each.append((self._noise(first, second, a, b), s.dof))
            elif s.key in _COMMON:
                each.append((math.hypot(*parts), s.dof))
            else:
                each.append((sum(parts), s.dof))
        combined = math.sqrt(math.fsum(v * v for v, _ in each))
        return coverage_factor(effective_dof(each)) * combined

    def _noise(self, first: FloatArray, second: FloatArray, a: int, b: int) -> float:
        shape = self.calibration.shape
        variance = 0.0
        at = [shape.basis(float(self.temps_degc[k])) for k in (a, b)]
        for i in range(3):
            own = [3 * i, 3 * i + 1, 3 * i + 2, 9 + i]
            g = np.outer(first[own], at[0]) + np.outer(second[own], at[1])
            variance += float(
                np.einsum("kp,kplq,lq->", g, self.calibration.parameter_covariance[i], g)
            )
        return math.sqrt(max(variance, 0.0))


def known(unit: UnitDescription, measurements: MeasurementSet, calibration: Calibration) -> Known:
    """Calibration with its uncertainty over the working range."""
    low, high = calibration.range_degc
    temps = np.unique([*np.linspace(low, high, _BETWEEN), np.clip(unit.t0_degc, low, high)])
    return Known(unit, calibration, uncertainty(unit, measurements, calibration, None, temps))


def bias_slopes(constants: FloatArray, axis: int) -> tuple[float, FloatArray]:
    """K0_i = U0_i / K_ii in g, and its derivatives (12,)."""
    K, U0 = unpack_constants(constants)
    own = K[axis, axis]
    slopes = np.zeros(12)
    slopes[9 + axis], slopes[4 * axis] = 1.0 / own, -U0[axis] / own**2
    return float(U0[axis] / own), slopes


def ratio_slopes(constants: FloatArray, axis: int, other: int) -> tuple[float, FloatArray]:
    """K_ij / K_ii, and its derivatives (12,)."""
    K, _ = unpack_constants(constants)
    own = K[axis, axis]
    slopes = np.zeros(12)
    slopes[3 * axis + other], slopes[4 * axis] = 1.0 / own, -K[axis, other] / own**2
    return float(K[axis, other] / own), slopes
