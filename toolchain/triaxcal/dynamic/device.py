"""[device] of unit.toml: what the codes of the firmware stand for, and where it works."""

from __future__ import annotations

import math
from dataclasses import dataclass

from triaxcal.base.keys import TableKeys, Values, keys_of, setting
from triaxcal.base.kinds import interval, number, whole
from triaxcal.model.thermal.shape import PLAUSIBLE_DEGC
from triaxcal.unit.adc import Adc, whole_adc
from triaxcal.unit.arithmetic import ARITHMETIC, PORTABLE
from triaxcal.unit.choices import OUTPUT_Q_RANGE
from triaxcal.unit.prefix import DEFAULT_PREFIX, PREFIX
from triaxcal.unit.thermometer import TemperatureSensor


@dataclass(frozen=True)
class Device:
    """What the firmware reads and gives. By default, results of +-128 g and +-4096 deg/s fit.

    Attributes
    ----------
    accel_bits
        Width of the signed raw code.
    accel_full_scale_g
        Reading of the code 2^(accel_bits - 1), in g of 9.80665 m/s^2.
    gyro_bits
        Width of the signed raw code.
    gyro_full_scale_deg_per_s
        Reading of the code 2^(gyro_bits - 1).
    range_degc
        Working range.
    accel_q
        LSB of an acceleration: 2^-accel_q g.
    gyro_rate_q
        LSB of a rate: 2^-gyro_rate_q deg/s.
    prefix
        What the names of functions, types, macros and files in the C begin with. Give each sensor
        of a program its own.
    arithmetic
        How the C forms its products, as in [firmware]. The gyro has limbs for thumb1 and the
        portable form for thumb2. Both have the portable form for high-words.
    """

    temperature_sensor: TemperatureSensor
    accel_bits: int = setting(whole(8, 32), unit="bit", example="16")
    accel_full_scale_g: float = setting(number(1e-3, 1e3), unit="g", example="16")
    gyro_bits: int = setting(whole(8, 32), unit="bit", example="16")
    gyro_full_scale_deg_per_s: float = setting(number(1e-3, 1e5), unit="deg/s", example="500")
    range_degc: tuple[float, float] = setting(
        interval(*PLAUSIBLE_DEGC), unit="degC", example="[-40, 85]"
    )
    accel_q: int = setting(whole(*OUTPUT_Q_RANGE), 24)
    gyro_rate_q: int = setting(whole(*OUTPUT_Q_RANGE), 19)
    prefix: str = setting(PREFIX, DEFAULT_PREFIX)
    arithmetic: str = setting(ARITHMETIC, PORTABLE)

    @property
    def accel_adc(self) -> Adc:
        """Codes of the accelerometers; "V" is g of 9.80665 m/s^2."""
        return whole_adc(self.accel_bits, self.accel_full_scale_g)

    @property
    def gyro_adc(self) -> Adc:
        """Codes of the gyros; "V" is rad/s."""
        return whole_adc(self.gyro_bits, math.radians(self.gyro_full_scale_deg_per_s))


DEVICE = TableKeys(
    "device",
    "What the firmware's codes stand for, and where it works. Without it there is no C.",
    (*keys_of(Device)[:4], *keys_of(TemperatureSensor), *keys_of(Device)[4:]),
    optional=True,
)
REQUIRED = tuple(key.name for key in DEVICE.keys if key.required)
"""Keys that [device] needs."""


def device_of(values: Values) -> Device | None:
    """[device], or None if there is none."""
    if not values:
        return None
    return values.record(Device, temperature_sensor=values.record(TemperatureSensor))
