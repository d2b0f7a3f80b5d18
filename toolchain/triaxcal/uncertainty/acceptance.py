"""What the uncertainty of |a| says of the unit's two limits."""

from __future__ import annotations

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
) -> tuple[tuple[float, float], bool]:
    """Expanded uncertainty (95 %) of |a| at T0 and over the range, worst orientation, in g.

    And whether it is all of it: a source may be unknown, as the change with temperature.
    """
    found = uncertainty(unit, measurements, calibration, device)
    length = found.force_u[:, :, LENGTH]
    both = float(length[found.t0_index].max()), float(length.max())
    return both, not any(s.unknown for s in found.sources)
