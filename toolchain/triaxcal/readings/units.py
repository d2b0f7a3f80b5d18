"""Units of temperature and angle, as functions of arrays."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from triaxcal.model.temperatures import ToDegc, degc_of_fahrenheit, degc_of_kelvin
from triaxcal.model.types import FloatArray
from triaxcal.unit.thermometer import TemperatureSensor

Conversion = Callable[[FloatArray], FloatArray]


def to_degc(unit: str, sensor: TemperatureSensor | None = None) -> Conversion:
    """Conversion of temperatures in "degC", "K", "degF" or codes ("code") of `sensor` to degC."""
    if sensor is not None and unit == "code":
        return lambda values: sensor.degc_at_zero + values * sensor.degc_per_code
    conversions: dict[str, ToDegc] = {
        "degC": lambda values: values,
        "K": degc_of_kelvin,
        "degF": degc_of_fahrenheit,
    }
    return conversions[unit]


def to_radians(unit: str) -> Conversion:
    """Conversion of angles in "deg" or "rad" to rad."""
    factor = np.pi / 180.0 if unit == "deg" else 1.0
    return lambda values: values * factor
