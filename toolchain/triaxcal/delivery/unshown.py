"""What readings cannot show by themselves: their scale."""

from __future__ import annotations

import numpy as np

from triaxcal.fitting.core.calibration import Calibration
from triaxcal.model.metrological import unpack_constants
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.priors import Priors

SCALE_SDS = 4.0
"""Of [priors] mean_scale: 1 of 16 000 units is farther off by chance. A factor of 2 either way is
5 or 10 of the default."""


def contradictions(unit: UnitDescription, calibration: Calibration) -> tuple[str, ...]:
    """What is known beforehand and contradicts the result: the scale of readings in a known unit.

    Constants follow any scale, and residuals show none: a full scale or a unit that is not that of
    the readings.
    """
    nominal = None if unit.recording is None else unit.recording.reading_of_1_g
    if nominal is None:
        return ()
    K, _ = unpack_constants(calibration.thermal.constants_at(unit.t0_degc))
    # The geometric mean of the three, however the sensor is turned.
    mean = float(np.abs(np.linalg.det(K)) ** (1.0 / 3.0))
    prior, reading = unit.priors.mean_scale, calibration.reading_unit
    sds = abs(mean / nominal - 1.0) / prior
    if sds <= SCALE_SDS:
        return ()
    default = " (the default)" if prior == Priors().mean_scale else ""
    words = (
        f"1 g reads {mean:.3g} {reading} where {nominal:.6g} {reading} is nominal, {sds:.2g} "
        f"standard deviations of [priors] mean_scale = {prior:g}{default}: check unit and full "
        "scale of the readings, or state mean_scale"
    )
    return (words,)
