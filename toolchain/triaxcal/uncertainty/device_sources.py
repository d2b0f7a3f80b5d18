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


def raw_code(p: Curves) -> Source:
    """Rounding of the reading to a code."""
    sd = p.unit.adc.volts_per_code / _ROOT_12
    return Source(
        key="raw_code",
        name="the rounding to raw codes",
        sd=sd,
        unit="V",
        distribution=RECTANGULAR,
        dof=math.inf,
        origin="one code, ± 1/2",
        advice="use more of the ADC's bits",
        constants=None,
        force=direct(p, p.inverse * sd),
    )


def temperature_code(p: Curves) -> Source:
    """Rounding of the temperature to a code."""
    sd = p.unit.temperature_sensor.degc_per_code / _ROOT_12
    return Source(
        key="temperature_code",
        name="the rounding to temperature codes",
        sd=sd,
        unit="°C",
        distribution=RECTANGULAR,
        dof=math.inf,
        origin="one code, ± 1/2",
        advice="use a finer temperature code",
        constants=None,
        force=from_factor(p, p.slopes.reshape(-1, 12, 1) * sd)[1],
    )


def output_lsb(p: Curves, device: Device) -> Source:
    """Rounding of the result."""
    sd = 2.0**-device.output_q / _ROOT_12
    return Source(
        key="output_lsb",
        name="the rounding of the result",
        sd=sd,
        unit="g",
        distribution=RECTANGULAR,
        dof=math.inf,
        origin=f"LSB of 2^-{device.output_q} g, ± 1/2",
        advice="raise compensation.output_q",
        constants=None,
        force=_each_axis(p, np.full(3, sd)),
    )


def arithmetic(p: Curves, device: Device) -> Source:
    """The proven bound of the integer arithmetic, without the final rounding."""
    beyond = np.array([max(bound - 0.5, 0.0) for bound in device.bound_lsb])
    sds = beyond * 2.0**-device.output_q / _ROOT_3
    return Source(
        key="arithmetic",
        name="the integer arithmetic",
        sd=float(sds.max()),
        unit="g",
        distribution=RECTANGULAR,
        dof=math.inf,
        origin="proven bound beyond the final rounding",
        advice="raise compensation.output_q",
        constants=None,
        force=_each_axis(p, sds),
    )


def method(p: Curves, device: Device) -> Source:
    """The compensation method's own distance from the fitted model."""
    sd = device.model_error_g / _ROOT_3
    return Source(
        key="method",
        name="the compensation method",
        sd=sd,
        unit="g",
        distribution=RECTANGULAR,
        dof=math.inf,
        origin="largest distance from K(T)^-1 (U - U0(T)) for any raw code",
        advice='lower compensation.model_error_max_micro_g, with method = "matrix"',
        constants=None,
        force=_each_axis(p, np.full(3, sd)),
    )


def _each_axis(p: Curves, sds_g: FloatArray) -> FloatArray:
    """Covariance of D of independent errors of the three axes."""
    return direct(p, np.broadcast_to(np.diag(sds_g), (len(p.temps_degc), 3, 3)))
