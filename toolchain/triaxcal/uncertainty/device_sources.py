"""Sources in the device: rounding of its codes, and the largest error of its C."""

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
            origin="at most half a code",
            sd=code_v,
            distribution=RECTANGULAR,
            force=direct(p, p.inverse * code_v),
        ),
        Source(
            key="temperature_code",
            name="the rounding to temperature codes",
            unit="°C",
            advice="use a finer temperature code",
            origin="at most half a code",
            sd=code_degc,
            distribution=RECTANGULAR,
            force=from_factor(p, p.slopes.reshape(-1, 12, 1) * code_degc)[1],
        ),
    ]
    return sources if device is None else [*sources, _of_firmware(p, device)]


def _of_firmware(p: Curves, device: Device) -> Source:
    """The proven bound of the arithmetic and the method's own distance, which add up."""
    arithmetic_g = np.array(device.bound_lsb) * 2.0**-device.output_q
    total_g = arithmetic_g + device.model_error_g
    of_method = device.model_error_g > arithmetic_g.max()
    return Source(
        key="firmware",
        name="the C against the fitted model",
        unit="g",
        advice=(
            'lower compensation.model_error_max_micro_g, with method = "matrix"'
            if of_method
            else "raise compensation.output_q"
        ),
        origin="proven arithmetic error and the method's distance from K(T)^-1 (U - U0(T)), added",
        sd=float(total_g.max()) / _ROOT_3,
        distribution=RECTANGULAR,
        force=_axes(p, total_g / _ROOT_3),
    )


def _axes(p: Curves, sds_g: FloatArray) -> FloatArray:
    """Covariance of D of independent errors of the three axes."""
    return direct(p, np.broadcast_to(np.diag(sds_g), (len(p.temps_degc), 3, 3)))
