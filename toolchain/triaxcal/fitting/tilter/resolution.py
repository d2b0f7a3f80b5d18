"""What one code of the converter is worth beside the limits.

One reading is rounded by up to half a code. The mean of readings that scatter over several codes is
not: its rounding averages out. The mean of readings that all show one code is, whatever the count.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.model.metrological import sensitivities
from triaxcal.readings.measurements import MeasurementSet
from triaxcal.unit.description import UnitDescription

_SCATTER = 0.5
"""Of a code: readings that scatter by less are rounded alike (`grouping.grouped_readings`)."""
_WHOLE = 1e-4
"""Of a code: how far from a whole one the mean of readings in V may be printed."""


@dataclass(frozen=True)
class Coarse:
    """A limit below half a code: the limit and its key, and one code, in g."""

    limit_g: float
    key: str
    code_g: float

    @property
    def words(self) -> str:
        """Both, in mg."""
        return (
            f"one code is {self.code_g * 1e3:.3g} mg: one reading is rounded by up to "
            f"{self.code_g * 500.0:.3g} mg, more than the limit of {self.limit_g * 1e3:g} mg "
            f"({self.key})"
        )


def coarse(unit: UnitDescription, calibration: Calibration) -> Coarse | None:
    """The smaller limit, where it is below half a code of the least sensitive output."""
    at_t0 = calibration.thermal.constants_at(calibration.thermal.t0_degc)
    scale = sensitivities(at_t0).min()
    code_g = unit.adc.volts_per_code / float(scale)
    limits = unit.limits
    limit_g, key = min(
        (limits.at_t0_g, "limits.at_t0_g"), (limits.over_range_g, "limits.over_range_g")
    )
    return Coarse(limit_g, key, code_g) if limit_g < 0.5 * code_g else None


def rounded_alike(unit: UnitDescription, measurements: MeasurementSet) -> bool:
    """Whether the dwells' means are as coarse as one reading, on an axis at least."""
    code = unit.adc.volts_per_code
    means = np.array([d.voltage_v for d in measurements.dwells]) / code
    whole = np.all(np.abs(means - np.rint(means)) < _WHOLE, axis=0)
    known = [d.sd_v for d in measurements.dwells if d.sd_v is not None]
    still = np.all(np.array(known) < _SCATTER * code, axis=0) if known else np.zeros(3, bool)
    return bool((whole | still).any())


def limit_below_a_code(
    unit: UnitDescription, calibration: Calibration, measurements: MeasurementSet
) -> RefusedError | None:
    """A refusal of a limit that the means, rounded as one reading is, cannot show."""
    found = coarse(unit, calibration)
    if found is None or not rounded_alike(unit, measurements):
        return None
    return RefusedError(
        f"{unit.source}, [limits] {found.key.removeprefix('limits.')}",
        f"{found.words}, and so are the means: the readings of a dwell show one code alone",
        expected=f"a limit of half a code at least, {found.code_g * 500.0:.3g} mg",
        remedy="raise the limit, or use more of the converter's bits",
    )


def code_notes(
    unit: UnitDescription, calibration: Calibration, measurements: MeasurementSet
) -> tuple[str, ...]:
    """What one code is, where a limit is below half of it and the means are finer."""
    found = coarse(unit, calibration)
    if found is None or rounded_alike(unit, measurements):
        return ()
    return (
        f"{found.words}; the means of the dwells are finer, and are what the limit is held against",
    )
