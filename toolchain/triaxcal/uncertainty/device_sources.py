"""Sources in the device: rounding of its codes and of its result, and the proven bounds."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from triaxcal.model.types import FloatArray
from triaxcal.uncertainty.propagation import Curves
from triaxcal.uncertainty.source import RECTANGULAR, Source, direct, from_factor

_ROOT_12, _ROOT_3 = math.sqrt(12.0), math.sqrt(3.0)


@dataclass(frozen=True)
class Device:
    """What is proven of the unit's firmware.

    Attributes
    ----------
    output_q : int
        LSB of the result is 2^-output_q g.
    bound_lsb : tuple of three floats
        Proven error of the arithmetic, its final rounding included, per axis.
    model_error_g : float
        Largest distance of the compensation method from K(T)^-1 (U - U0(T)).
    """

    output_q: int
    bound_lsb: tuple[float, float, float]
    model_error_g: float


def device_sources(p: Curves, device: Device | None) -> list[Source]:
    """Rounding of the codes, and what is proven of the firmware, if there is one."""
    code_v = p.unit.adc.volts_per_code / _ROOT_12
    code_degc = p.unit.temperature_sensor.degc_per_code / _ROOT_12
    sources = [
        Source(
            key="raw_code",
            name="the rounding to raw codes",
            unit="V",
            advice="use more of the ADC's bits",
            origin="one code, ± 1/2",
            sd=code_v,
            distribution=RECTANGULAR,
            force=direct(p, p.inverse * code_v),
        ),
        Source(
            key="temperature_code",
            name="the rounding to temperature codes",
            unit="°C",
            advice="use a finer temperature code",
            origin="one code, ± 1/2",
            sd=code_degc,
            distribution=RECTANGULAR,
            force=from_factor(p, p.slopes.reshape(-1, 12, 1) * code_degc)[1],
        ),
    ]
    return sources if device is None else sources + _of_firmware(p, device)


def _of_firmware(p: Curves, device: Device) -> list[Source]:
    """Rounding of the result, the proven bound without it, the method's own distance."""
    lsb_g = 2.0**-device.output_q
    beyond = np.array([max(bound - 0.5, 0.0) for bound in device.bound_lsb])
    found = (
        (
            "output_lsb",
            "the rounding of the result",
            "raise compensation.output_q",
            f"LSB of 2^-{device.output_q} g, ± 1/2",
            np.full(3, lsb_g / _ROOT_12),
        ),
        (
            "arithmetic",
            "the integer arithmetic",
            "raise compensation.output_q",
            "proven bound beyond the final rounding",
            beyond * lsb_g / _ROOT_3,
        ),
        (
            "method",
            "the compensation method",
            'lower compensation.model_error_max_micro_g, with method = "matrix"',
            "largest distance from K(T)^-1 (U - U0(T)) for any raw code",
            np.full(3, device.model_error_g / _ROOT_3),
        ),
    )
    return [
        Source(key, name, "g", advice, origin, float(sds.max()), RECTANGULAR, force=_axes(p, sds))
        for key, name, advice, origin, sds in found
    ]


def _axes(p: Curves, sds_g: FloatArray) -> FloatArray:
    """Covariance of D of independent errors of the three axes."""
    return direct(p, np.broadcast_to(np.diag(sds_g), (len(p.temps_degc), 3, 3)))
