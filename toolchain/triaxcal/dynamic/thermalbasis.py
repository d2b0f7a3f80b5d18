"""The functions of temperature that one solution holds at once: the span of all candidates.

The filter is linear in the coefficients of any functions, so one solution with functions that
span those of every candidate holds the solutions of all of them. Functions whose shapes nest, as
polynomials do, are in it exactly; of the others, what is left of them beside those over the
recorded temperatures, down to `SMALLEST` of its size. All vanish at the reference temperature T0,
where the constants themselves stand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from triaxcal.dynamic.blocks.base import (
    ACCELEROMETER_BIAS,
    ACCELEROMETER_MATRIX,
    GYRO_BIAS,
    GYRO_MATRIX,
)
from triaxcal.dynamic.blocks.block import Rows, Signals, State, StateBlock
from triaxcal.model.curves import PiecewisePolynomial, on_common_breaks
from triaxcal.model.thermal.registry import THERMAL_FUNCTIONS
from triaxcal.model.thermal.shape import ThermalShape
from triaxcal.model.types import FloatArray

GROUPS = (ACCELEROMETER_BIAS, ACCELEROMETER_MATRIX, GYRO_BIAS, GYRO_MATRIX)
"""Blocks whose states follow the temperature; each has a function of its own."""
OF_GYROS = (GYRO_BIAS.name, GYRO_MATRIX.name)
"""Those that follow the gyros' thermometer."""
PRIOR = {"ppm": 1e4, "arcsec": 400.0}
"""Of a term of a matrix: 1 %, 2 mrad. Over temperature a unit changes by less than it is off."""
PART = 0.2
"""Of a term of a bias: of the prior of the bias."""
SMALLEST = 0.03
EXACT = 1e-7


@dataclass(frozen=True)
class Basis:
    """Functions of temperature that are zero at T0.

    Attributes
    ----------
    t0_degc : float
    shapes : tuple of ThermalShape
        Their bases, one after the other, are what the functions are made of.
    weights : array, shape (all parameters of the shapes, m)
    recorded_degc : array, shape (k,)
    """

    t0_degc: float
    shapes: tuple[ThermalShape, ...]
    weights: FloatArray
    recorded_degc: FloatArray

    @classmethod
    def spanning(
        cls, shapes: Sequence[ThermalShape], t0_degc: float, recorded_degc: FloatArray
    ) -> Basis:
        """Functions that span the shapes over the recorded temperatures, of rms 1 there."""
        kinds = tuple(shapes)
        columns = _less_t0(kinds, t0_degc, recorded_degc)
        nested = np.repeat(
            [THERMAL_FUNCTIONS[s.name].nested for s in kinds], [s.parameters for s in kinds]
        )
        weights = np.zeros((columns.shape[1], 0))
        for part, least in ((nested, EXACT), (~nested, SMALLEST)):
            found = columns[:, part]
            size = np.sqrt((found**2).mean(axis=0))
            scale = np.where(size > EXACT * size.max(initial=1.0), 1 / np.maximum(size, 1e-12), 0.0)
            new = np.zeros((columns.shape[1], scale.size))
            new[np.flatnonzero(part), np.arange(scale.size)] = scale
            known = columns @ weights
            new = new - weights @ np.linalg.lstsq(known, columns @ new, rcond=None)[0]
            _, singular, vt = np.linalg.svd(columns @ new, full_matrices=False)
            keep = singular > least * np.sqrt(len(recorded_degc))
            turned = new @ vt[keep].T / singular[keep] * np.sqrt(len(recorded_degc))
            weights = np.column_stack([weights, turned])
        return cls(t0_degc, kinds, weights, recorded_degc)

    @property
    def terms(self) -> int:
        """m: how many functions there are."""
        return int(self.weights.shape[1])

    def __call__(self, temp_degc: FloatArray) -> FloatArray:
        """Values (n, m) at temperatures (n,)."""
        return self._curves(temp_degc)

    @cached_property
    def _curves(self) -> PiecewisePolynomial:
        """The same as one polynomial a segment."""
        ends = np.cumsum([shape.parameters for shape in self.shapes])[:-1]
        own = np.split(self.weights.T, ends, axis=1)
        parts = [shape.curves(w) for shape, w in zip(self.shapes, own, strict=True)]
        breaks, origins, coefficients = on_common_breaks(parts, self.t0_degc)
        total = np.sum(coefficients, axis=0)
        at_t0 = PiecewisePolynomial(breaks, origins, total)(self.t0_degc)
        total[:, :, 0] -= at_t0
        return PiecewisePolynomial(breaks, origins, total)

    def of_shape(self, shape: ThermalShape) -> tuple[FloatArray, FloatArray]:
        """What a shape is in these functions: values at T0 (P,) and coefficients (m, P).

        A curve of parameters q is value @ q at T0, and changes by the functions times
        coefficients @ q.
        """
        value = shape.basis(self.t0_degc)
        change = shape.basis(self.recorded_degc) - value
        found = np.linalg.lstsq(self(self.recorded_degc), change, rcond=None)[0]
        return value, found.astype(np.float64)


def _less_t0(shapes: tuple[ThermalShape, ...], t0_degc: float, temp_degc: FloatArray) -> FloatArray:
    parts = [shape.basis(temp_degc) - shape.basis(t0_degc) for shape in shapes]
    return np.concatenate(parts, axis=-1)


def block_over_temperature(block: StateBlock, basis: Basis, reference_degc: float) -> StateBlock:
    """The change of a block's states with temperature: `terms` states for each, in its unit.

    Signals count their temperatures from `reference_degc`.
    """
    states = tuple(
        State(f"{s.name}~{k + 1}", s.unit, s.per_unit, prior_of_term(s), f"{s.label}, {k + 1}")
        for s in block.states
        for k in range(basis.terms)
    )
    return StateBlock(
        over_temperature(block.name),
        f"{block.title} over temperature",
        states,
        rate=_rows(block.rate, basis, reference_degc),
        force=_rows(block.force, basis, reference_degc),
        needs="temp_degc",
        shown=False,
    )


def prior_of_term(state: State) -> float:
    """Standard deviation of a term of a constant, in its unit: functions have rms 1."""
    return PRIOR.get(state.unit, PART * state.prior_sd)


def over_temperature(name: str) -> str:
    """Name of the block that holds the change of another's states."""
    return f"{name}-over-temperature"


def _rows(rows: Rows | None, basis: Basis, reference_degc: float) -> Rows | None:
    if rows is None:
        return None

    def times(signals: Signals) -> FloatArray:
        values = basis(signals.delta_degc + reference_degc)
        own = rows(signals)
        product: FloatArray = own[:, :, :, None] * values[:, None, None, :]
        return product.reshape(*own.shape[:2], -1)

    return times
