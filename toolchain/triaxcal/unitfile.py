"""The description of one unit: units/<UNIT>/unit.toml."""

from __future__ import annotations

from dataclasses import dataclass

ESTIMATORS = ("equation-10", "least-squares", "half-sum")
THERMAL_MODELS = ("polynomial", "piecewise-linear")
METHODS = ("matrix", "inverse", "additive", "additive-simplified", "additive-first-order")


@dataclass(frozen=True)
class Adc:
    """How a raw code stands for a voltage: U = code * full_scale_v / 2^(bits - 1)."""

    bits: int
    full_scale_v: float
    code_min: int
    code_max: int

    @property
    def volts_per_code(self) -> float:
        """Volts of one code."""
        return float(self.full_scale_v / 2 ** (self.bits - 1))


@dataclass(frozen=True)
class TemperatureSensor:
    """How a temperature code stands for a temperature: T = code * degc_per_code + degc_at_zero."""

    degc_per_code: float
    degc_at_zero: float

    def degc(self, code: float) -> float:
        """Temperature of a code."""
        return code * self.degc_per_code + self.degc_at_zero

    def code(self, temp_degc: float) -> int:
        """Nearest code of a temperature."""
        return round((temp_degc - self.degc_at_zero) / self.degc_per_code)


@dataclass(frozen=True)
class ThermalChoice:
    """Which thermal functions to fit; `model` "auto" tries them all on held-out data.

    `order` belongs to "polynomial", `knots_degc` to "piecewise-linear"; None is the default.
    """

    model: str
    order: int | None
    knots_degc: tuple[float, ...] | None


@dataclass(frozen=True)
class Limits:
    """Largest | |a| - g | accepted after compensation, P1 (13), in g."""

    at_t0_g: float
    over_range_g: float


@dataclass(frozen=True)
class UnitDescription:
    """One unit, validated.

    Attributes
    ----------
    name : str
        Name of the unit's folder.
    gravity_g : float
        Local gravity in g of 9.80665 m/s^2.
    range_degc : tuple of two floats, or None
        Working temperature range; None is the calibrated range.
    polarity : tuple of three signs, or None
        Signs of Kxx, Kyy, Kzz; None means that all three are alike.
    """

    name: str
    serial: str
    adc: Adc
    temperature_sensor: TemperatureSensor
    gravity_g: float
    t0_degc: float
    range_degc: tuple[float, float] | None
    polarity: tuple[int, int, int] | None
    estimator: str
    thermal: ThermalChoice
    method: str
    output_q: int
    model_error_max_micro_g: float
    limits: Limits
