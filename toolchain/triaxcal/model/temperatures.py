"""What a temperature is written as instead of degC, on purpose or by mistake."""

from __future__ import annotations

from collections.abc import Callable

from triaxcal.model.types import FloatArray

ToDegc = Callable[[FloatArray], FloatArray]


def degc_of_kelvin(temps: FloatArray) -> FloatArray:
    """DegC of kelvin."""
    return temps - 273.15


def degc_of_fahrenheit(temps: FloatArray) -> FloatArray:
    """DegC of degrees Fahrenheit."""
    return (temps - 32.0) / 1.8


MISTAKES: dict[str, ToDegc] = {
    "an unsigned byte": lambda temps: temps - 256.0,
    "a byte of the wrong sign": lambda temps: temps + 256.0,
    "kelvin": degc_of_kelvin,
    "kelvin taken off twice": lambda temps: temps + 273.15,
    "degrees Fahrenheit": degc_of_fahrenheit,
}
"""Mistakes in words, each with what gives degC again."""
