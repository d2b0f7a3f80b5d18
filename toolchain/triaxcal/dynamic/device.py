"""[device] of unit.toml: what the codes of the firmware stand for, and where it works."""

from __future__ import annotations

import math
from dataclasses import dataclass

from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import Table
from triaxcal.unit.description import OUTPUT_Q_RANGE, PLAUSIBLE_DEGC, Adc, TemperatureSensor

DEVICE_KEYS = {
    "accel_bits": True,
    "accel_full_scale_g": True,
    "gyro_bits": True,
    "gyro_full_scale_deg_per_s": True,
    "degc_per_code": True,
    "degc_at_zero": False,
    "range_degc": True,
    "accel_q": False,
    "gyro_rate_q": False,
}
"""Keys of [device]; True where it needs them."""
REQUIRED = tuple(key for key, needed in DEVICE_KEYS.items() if needed)
ACCEL_Q, GYRO_RATE_Q = 24, 19
"""Results of +-128 g and +-4096 deg/s fit."""


@dataclass(frozen=True)
class Device:
    """What the firmware reads and gives.

    Attributes
    ----------
    accel_adc, gyro_adc : Adc
        Codes of both triads; "V" is g of 9.80665 m/s^2, and rad/s.
    temperature_sensor : TemperatureSensor
    range_degc : tuple of two floats
        Working range.
    accel_q, gyro_rate_q : int
        LSB of the results: 2^-accel_q g, 2^-gyro_rate_q deg/s.
    """

    accel_adc: Adc
    gyro_adc: Adc
    temperature_sensor: TemperatureSensor
    range_degc: tuple[float, float]
    accel_q: int
    gyro_rate_q: int


def device_of(table: Table) -> Device | None:
    """[device], or None where there is none.

    Raises
    ------
    RefusedError
        For a missing key, a wrong type, a value out of range.
    """
    if not table.values:
        return None
    missing = [key for key in REQUIRED if key not in table]
    if missing:
        raise RefusedError(
            table.where(missing[0]),
            "missing" + (", and so " + ", ".join(missing[1:]) if missing[1:] else ""),
            expected="it, where [device] is given",
        )
    low, high = table.rising("range_degc", *PLAUSIBLE_DEGC, range(2, 3))
    at_zero = table.number("degc_at_zero", -1e4, 1e4) if "degc_at_zero" in table else 0.0
    return Device(
        accel_adc=_adc(table, "accel_bits", table.number("accel_full_scale_g", 1e-3, 1e3)),
        gyro_adc=_adc(
            table, "gyro_bits", math.radians(table.number("gyro_full_scale_deg_per_s", 1e-3, 1e5))
        ),
        temperature_sensor=TemperatureSensor(table.number("degc_per_code", 1e-6, 10.0), at_zero),
        range_degc=(low, high),
        accel_q=_q(table, "accel_q", ACCEL_Q),
        gyro_rate_q=_q(table, "gyro_rate_q", GYRO_RATE_Q),
    )


def _adc(table: Table, key: str, full_scale: float) -> Adc:
    bits = table.integer(key, 8, 32)
    half = 2 ** (bits - 1)
    return Adc(bits, full_scale, -half, half - 1)


def _q(table: Table, key: str, default: int) -> int:
    return table.integer(key, *OUTPUT_Q_RANGE) if key in table else default
