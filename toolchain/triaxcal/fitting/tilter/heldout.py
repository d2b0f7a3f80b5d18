"""What readings outside the fit say: temperatures held out in turn, and check dwells.

Each calibration temperature but the lowest and highest is held out in turn: the force in its six
positions, by curves fitted without it, against the known force. That needs four temperatures,
because three must remain to show a curvature. Check dwells are never fitted: |a| - g.

Curves that need every temperature are fitted with a parameter less, and the error is then that of
the smaller function, not of the delivered one. How much smaller the delivered curves' error is
shows in how the held-out error falls from order to order. With e(P) the held-out error of P
parameters, one parameter gains on average the factor

    r = sqrt(e(P - 1) / e(P - 3)), at most 1,

over the last two orders that can be held out (two, because a curve that is mostly even or odd
gains in every other order). The delivered P parameters then have about r e(P - 1). Curves that
are smooth gain quickly; readings that contradict each other, such as a temperature with the wrong
sign, gain nothing from any order, and r is 1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from triaxcal.fitting.core.grouping import GroupedReadings, TemperatureGroup
from triaxcal.fitting.core.judged import HeldOutDwell, HeldOutTest
from triaxcal.fitting.tilter.curves import TilterData, fit_curves
from triaxcal.model.metrological import force_from_voltage
from triaxcal.model.terms import Terms
from triaxcal.model.thermal.registry import THERMAL_FUNCTIONS
from triaxcal.model.thermal.shape import EDGE_DEGC, GROUP_GAP_DEGC, ThermalShape
from triaxcal.model.types import FloatArray
from triaxcal.readings.measurements import Dwell

LEAST_TEMPERATURES = 4
"""Fewer leave no curvature when one is held out."""


@dataclass(frozen=True)
class Fold:
    """The readings without one temperature, and those of that temperature."""

    remaining: TilterData
    left_out: GroupedReadings

    def shape(self, shape: ThermalShape) -> ThermalShape:
        """The function that the remaining temperatures determine."""
        temps = self.remaining.readings.temps_degc
        return shape.without(temps, float(self.left_out.temps_degc[0]))

    def force_errors(self, shape: ThermalShape) -> FloatArray:
        """Computed minus known force (E, 1, 6, 3) in g by curves fitted without the temperature."""
        reduced = self.shape(shape)
        return vector_errors(self.left_out, reduced, fit_curves(self.remaining, reduced),
                             self.remaining.design)  # fmt: skip


def folds_of(data: TilterData) -> list[Fold]:
    """Each inner temperature held out in turn; none with fewer than four temperatures."""
    count = len(data.readings.temps_degc)
    return [
        Fold(
            remaining=data.select([g for g in range(count) if g != left_out]),
            left_out=data.readings.select([left_out]),
        )
        for left_out in (range(1, count - 1) if count >= LEAST_TEMPERATURES else ())
    ]


def scored_checks(data: TilterData, checks: Sequence[Dwell]) -> list[Dwell]:
    """Check dwells within the calibrated temperatures."""
    low, high = data.readings.temps_degc[0], data.readings.temps_degc[-1]
    return [d for d in checks if low - EDGE_DEGC <= d.temp_degc <= high + EDGE_DEGC]


def vector_errors(
    readings: GroupedReadings, shape: ThermalShape, parameters: FloatArray, design: FloatArray
) -> FloatArray:
    """Computed minus known force, shape (E, G, 6, 3), g; each dwell at its own temperature."""
    basis = shape.basis(readings.dwell_temps_degc)
    constants = basis @ np.swapaxes(parameters, -1, -2)[:, None]
    return force_from_voltage(constants, readings.voltage_v) - design[:, :3]


def check_errors(
    shape: ThermalShape,
    parameters: FloatArray,
    checks: Sequence[Dwell],
    gravity_g: float,
    terms: Terms,
) -> FloatArray:
    """|a| - g of P1 (13) at check dwells, shape (E, dwells), g; parameters (E, 12, P)."""
    temps = np.array([d.temp_degc for d in checks], dtype=np.float64)
    voltage = np.array([d.voltage_v for d in checks], dtype=np.float64).reshape(-1, 3)
    constants = shape.basis(temps) @ np.swapaxes(parameters, -1, -2)
    force = terms.force_g(force_from_voltage(constants, voltage))
    error: FloatArray = np.linalg.norm(force, axis=-1) - gravity_g
    return error


def held_out_test(
    data: TilterData,
    shape: ThermalShape,
    groups: Sequence[TemperatureGroup],
    checks: Sequence[Dwell],
) -> HeldOutTest:
    """The chosen shape on what its fit does not use; `data` has the chosen estimator alone."""
    folds = folds_of(data)
    errors = [fold.force_errors(shape)[0, 0] for fold in folds]
    known = data.design[:, :3]
    dwells = [
        HeldOutDwell(
            d.row,
            d.position,
            d.temp_degc,
            float(np.linalg.norm(known[k] + error[k]) - np.linalg.norm(known[k])),
        )
        for group, error in zip(groups[1:-1], errors, strict=False)
        for k, d in enumerate(group.dwells)
    ]
    temps = data.readings.temps_degc
    between = bool(folds) or any(
        np.abs(temps - d.temp_degc).min() > GROUP_GAP_DEGC for d in scored_checks(data, checks)
    )
    rms = root_mean_square(np.array(errors)) if errors else None
    reduced = folds[0].shape(shape) if folds else shape
    return HeldOutTest(tuple(dwells), rms, reduced.label, share_of(folds, shape), between)


def share_of(folds: Sequence[Fold], shape: ThermalShape) -> float:
    """r of the module's text: 1 but for a nested shape that needs every temperature."""
    smaller = shape.parameters - 3
    if not folds or folds[0].shape(shape).parameters == shape.parameters:
        return 1.0
    if smaller < 1 or not THERMAL_FUNCTIONS[shape.name].nested:
        return 1.0
    before = _rms_over(folds, shape.nested(smaller))
    return min(1.0, math.sqrt(_rms_over(folds, shape) / before)) if before else 1.0


def _rms_over(folds: Sequence[Fold], shape: ThermalShape) -> float:
    return root_mean_square(np.array([fold.force_errors(shape)[0] for fold in folds]))


def root_mean_square(values: FloatArray) -> float:
    """Rms of all values."""
    return float(np.sqrt(np.mean(values**2)))
