"""What the uncertainty of |a| says of the unit's two limits."""

from __future__ import annotations

import math

from triaxcal.fitting.core.calibration import Calibration
from triaxcal.readings.measurements import MeasurementSet
from triaxcal.uncertainty.device_sources import Device
from triaxcal.uncertainty.evaluate import LENGTH, uncertainty
from triaxcal.unit.description import UnitDescription


def length_uncertainty_g(
    unit: UnitDescription,
    measurements: MeasurementSet,
    calibration: Calibration,
    device: Device | None = None,
) -> tuple[float, float]:
    """Expanded uncertainty (95 %) of |a| at T0 and over the range, worst orientation, in g.

    Infinite where a source is unknown.
    """
    found = uncertainty(unit, measurements, calibration, device)
    if any(s.unknown for s in found.sources):
        return math.inf, math.inf
    length = found.force_u[:, :, LENGTH]
    return float(length[found.t0_index].max()), float(length.max())
