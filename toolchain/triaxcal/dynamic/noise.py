"""Noise of the sensors as their data sheets state it, and as the filter needs it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields, replace

from triaxcal.base.keys import setting
from triaxcal.base.kinds import number
from triaxcal.dynamic.recording import INCREMENT

MICRO_G = 9.80665e-6
"""Of standard gravity, as data sheets mean it; m/s^2."""


RESTS = "from the rests"
LIKELY = "from the recording"


@dataclass(frozen=True)
class DataSheet:
    """[noise]: noise of both triads, as data sheets state it.

    White noise: a mean over t seconds scatters by N / sqrt(t). Data sheets write the velocity
    random walk N, micro-g sqrt(s), in micro-g/sqrt(Hz). (A one-sided spectral density is sqrt(2)
    times N.) Bias instability is the lowest Allan deviation, 0.664 B with B of IEEE 952; a random
    walk K has the Allan deviation K sqrt(t / 3).

    Attributes
    ----------
    gyro_arw_deg_per_sqrt_h
        Angle random walk N of the gyros: a mean over t scatters by N/sqrt(t).
    accel_vrw_ug_per_sqrt_hz
        Velocity random walk N of the accelerometers.
    second_vrw_ug_per_sqrt_hz
        Velocity random walk of the second accelerometer triad.
    accel_lsb
        One count of the accelerometers: micro-g for instants, mm/s for increments.
    table_sd_arcsec
        One reading of the table's angle, at rest.
    axis_wobble_arcsec
        How far the table's axis leans while it turns.
    gyro_bias_instability_deg_per_h
        Bias instability of the gyros: the lowest Allan deviation.
    accel_bias_instability_ug
        Bias instability of the accelerometers, of both triads: the lowest Allan deviation.
    gyro_random_walk_deg_per_h_per_sqrt_h
        Rate random walk K of the gyros.
    accel_random_walk_ug_per_sqrt_h
        Acceleration random walk K, of both triads.
    """

    gyro_arw_deg_per_sqrt_h: float | None = setting(
        number(1e-6, 100.0), None, "deg/sqrt(h)", words=RESTS, example="0.3"
    )
    accel_vrw_ug_per_sqrt_hz: float | None = setting(
        number(1e-3, 1e5), None, "micro-g/sqrt(Hz)", words=RESTS, example="100"
    )
    second_vrw_ug_per_sqrt_hz: float | None = setting(
        number(1e-3, 1e5), None, "micro-g/sqrt(Hz)", words="as the first", example="100"
    )
    accel_lsb: float = setting(number(0.0, 1e6), 0.0, "micro-g or mm/s")
    table_sd_arcsec: float | None = setting(number(1e-3, 1e5), None, "arcsec", example="60")
    axis_wobble_arcsec: float | None = setting(number(1e-3, 1e5), None, "arcsec", example="30")
    gyro_bias_instability_deg_per_h: float | None = setting(
        number(0.0, 1e4), None, "deg/h", words=LIKELY, example="2"
    )
    accel_bias_instability_ug: float | None = setting(
        number(0.0, 1e5), None, "micro-g", words=LIKELY, example="15"
    )
    gyro_random_walk_deg_per_h_per_sqrt_h: float = setting(number(0.0, 1e4), 0.0, "deg/h/sqrt(h)")
    accel_random_walk_ug_per_sqrt_h: float = setting(number(0.0, 1e5), 0.0, "micro-g/sqrt(h)")

    @property
    def rate_density(self) -> float:
        """Rad per sqrt(s)."""
        assert self.gyro_arw_deg_per_sqrt_h is not None
        return math.radians(self.gyro_arw_deg_per_sqrt_h) / 60

    def force_density(self, second: bool = False) -> float:
        """m/s^2 sqrt(s)."""
        stated = self.second_vrw_ug_per_sqrt_hz
        density = stated if second and stated is not None else self.accel_vrw_ug_per_sqrt_hz
        assert density is not None
        return density * MICRO_G

    def noisier(self, rate: float, force: float) -> DataSheet:
        """The same with so many times the white noise of gyros and of accelerometers."""
        arw, vrw = self.gyro_arw_deg_per_sqrt_h, self.accel_vrw_ug_per_sqrt_hz
        assert arw is not None
        assert vrw is not None
        return replace(
            self, gyro_arw_deg_per_sqrt_h=rate * arw, accel_vrw_ug_per_sqrt_hz=force * vrw
        )

    def mean_force_variance(
        self, duration_s: float, samples: float, convention: str, second: bool = False
    ) -> float:
        """Variance of the mean of a block of samples, (m/s^2)^2, with the counting of `accel_lsb`.

        Each instant is rounded alone. An increment leaves its rest of a count to the next one, so
        that only the two ends are rounded.
        """
        if convention == INCREMENT:
            counting = 2 * (self.accel_lsb * 1e-3 / duration_s) ** 2 / 12
        else:
            counting = (self.accel_lsb * MICRO_G) ** 2 / 12 / samples
        return self.force_density(second) ** 2 / duration_s + counting


def not_stated(stated: DataSheet, used: DataSheet) -> tuple[str, ...]:
    """Names of the figures that were used and are not those stated, in their order.

    Counts are in the white noise of the rests, so both go together.
    """
    none = {f.name for f in fields(DataSheet) if getattr(stated, f.name) is None}
    if "accel_vrw_ug_per_sqrt_hz" in none and stated.accel_lsb != used.accel_lsb:
        none.add("accel_lsb")
    shown = (f.name for f in fields(DataSheet) if f.name in none)
    return tuple(name for name in shown if getattr(used, name) is not None)


def noise_section(noise: DataSheet, names: Iterable[str]) -> list[str]:
    """Lines of a [noise] with these figures, for unit.toml."""
    return ["[noise]", *(f"{name} = {getattr(noise, name):g}" for name in names)]
