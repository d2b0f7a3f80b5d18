"""[device] of unit.toml: what the codes of the firmware stand for, and where it works."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import TableKeys, Values, keys_of, setting
from triaxcal.base.kinds import interval, number, whole
from triaxcal.model.thermal.shape import PLAUSIBLE_DEGC
from triaxcal.unit.adc import Adc, whole_adc
from triaxcal.unit.angles import AngleKeys, AnglesChoice
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
    gyro_degc_per_code
        Of the gyros' thermometer, where they have one of their own: [dynamic] `gyro_temp_column`.
    gyro_degc_at_zero
        Temperature of its code 0.
    gyro_range_degc
        Working range by it.
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
    angles : AnglesChoice or None
        Which angles the device makes of the compensated acceleration, as in [firmware].
    """

    temperature_sensor: TemperatureSensor
    accel_bits: int = setting(whole(8, 32), unit="bit", example="16")
    accel_full_scale_g: float = setting(number(1e-3, 1e3), unit="g", example="16")
    gyro_bits: int = setting(whole(8, 32), unit="bit", example="16")
    gyro_full_scale_deg_per_s: float = setting(number(1e-3, 1e5), unit="deg/s", example="500")
    range_degc: tuple[float, float] = setting(
        interval(*PLAUSIBLE_DEGC), unit="degC", example="[-40, 85]"
    )
    gyro_degc_per_code: float | None = setting(number(1e-6, 10.0), None, "degC", example="0.01")
    gyro_degc_at_zero: float | None = setting(number(-1e4, 1e4), None, "degC", words="0")
    gyro_range_degc: tuple[float, float] | None = setting(
        interval(*PLAUSIBLE_DEGC), None, "degC", words="`range_degc`"
    )
    accel_q: int = setting(whole(*OUTPUT_Q_RANGE), 24)
    gyro_rate_q: int = setting(whole(*OUTPUT_Q_RANGE), 19)
    prefix: str = setting(PREFIX, DEFAULT_PREFIX)
    arithmetic: str = setting(ARITHMETIC, PORTABLE)
    angles: AnglesChoice | None = None

    @property
    def two_thermometers(self) -> bool:
        """Whether the gyros have a thermometer of their own."""
        return self.gyro_degc_per_code is not None

    @property
    def gyro_temperature_sensor(self) -> TemperatureSensor:
        """Thermometer of the gyros."""
        if self.gyro_degc_per_code is None:
            return self.temperature_sensor
        return TemperatureSensor(self.gyro_degc_per_code, self.gyro_degc_at_zero or 0.0)

    @property
    def gyro_range(self) -> tuple[float, float]:
        """Working range by the gyros' thermometer."""
        return self.gyro_range_degc or self.range_degc

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
    (
        *keys_of(Device)[:4],
        *keys_of(TemperatureSensor),
        *keys_of(Device)[4:],
        *keys_of(AngleKeys),
    ),
    optional=True,
)
REQUIRED = tuple(key.name for key in DEVICE.keys if key.required)
"""Keys that [device] needs."""


def device_of(values: Values) -> Device | None:
    """[device], or None if there is none.

    Raises
    ------
    RefusedError
        When keys of a thermometer of the gyros are given without its scale.
    """
    if not values:
        return None
    found = values.record(
        Device,
        temperature_sensor=values.record(TemperatureSensor),
        angles=values.record(AngleKeys).choice,
    )
    for key in ("gyro_degc_at_zero", "gyro_range_degc"):
        if key in values and not found.two_thermometers:
            raise RefusedError(
                values.where(key),
                "given, and no gyro_degc_per_code",
                expected="gyro_degc_per_code as well: the gyros have a thermometer of their own",
            )
    return found


def refuse_other_thermometers(device: Device | None, own_column: bool, path: Path) -> None:
    """Refuse a thermometer of the gyros that was recorded and that the device lacks, or reverse.

    Raises
    ------
    RefusedError
    """
    if device is None or device.two_thermometers == own_column:
        return
    key, other = "[dynamic] gyro_temp_column", "[device] gyro_degc_per_code"
    given, missing = (key, other) if own_column else (other, key)
    raise RefusedError(
        f"{path}, {given}",
        f"given, and no {missing}",
        expected=f"{missing} as well, or neither",
        remedy="the device must read the thermometer that was recorded",
    )
