"""The words of `triax_calib_t` as a calibration tool sees them.

The conversions are linear and give the value that the coefficient of x^k stands for: 1/2 for the
floor after it and the preloaded half LSB of the output are taken off (fixed-point.md).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from triaxcal.codegen.constants import function_format
from triaxcal.codegen.names import names_of
from triaxcal.delivery.firmware import Firmware
from triaxcal.fixedpoint.formats import FUNCTION_NAMES
from triaxcal.fixedpoint.gyro import SENSITIVITY_NAMES, sensitivity_log2
from triaxcal.fixedpoint.plan import Plan
from triaxcal.fixedpoint.quadratic import QUADRATIC_NAMES, quadratic_log2
from triaxcal.fixedpoint.rate import RATE_Q
from triaxcal.model.methods.method import INVERSE
from triaxcal.model.positions import AXES
from triaxcal.unit.thermometer import TemperatureSensor

_WORD = 4
_HEAD_WORDS, _SEGMENT_HEAD_WORDS = 2, 3


@dataclass(frozen=True)
class Method:
    """A linear conversion: physical = slope * integer + intercept."""

    name: str
    text: str
    unit: str
    slope: float
    intercept: float

    @property
    def limits(self) -> tuple[float, float]:
        """Physical values of the ends of int32, rising."""
        ends = [self.slope * v + self.intercept for v in (-(2.0**31), 2.0**31 - 1.0)]
        return min(ends), max(ends)

    def prefixed(self, prefix: str) -> Method:
        """The same with a prefix in its name."""
        return replace(self, name=f"{prefix}_{self.name}")


@dataclass(frozen=True)
class Word:
    """One int32 of `triax_calib_t`."""

    name: str
    text: str
    offset: int
    method: Method


def calib_words(firmware: Firmware) -> list[Word]:
    """Every adjustable word of the constants of a unit."""
    return plan_words(firmware.plan, firmware.fitted.unit.temperature_sensor)


def plan_words(plan: Plan, sensor: TemperatureSensor) -> list[Word]:
    """Every adjustable word of the constants; the gains of x, which fix formats, are none."""
    prefix = names_of(plan).triad.upper()
    return [
        replace(word, name=f"{prefix}_{word.name}", method=word.method.prefixed(prefix))
        for word in _words(plan, sensor)
    ]


def temperature_method(sensor: TemperatureSensor) -> Method:
    """Of temperature codes."""
    return Method(
        "TEMPERATURE", "temperature code", "degC", sensor.degc_per_code, sensor.degc_at_zero
    )


def _words(plan: Plan, sensor: TemperatureSensor) -> list[Word]:
    """The same, without the prefix of the names."""
    temperature = temperature_method(sensor)
    words = [
        Word("temp_min", "lowest temperature of the range", 0, temperature),
        Word("temp_max", "highest temperature of the range", _WORD, temperature),
    ]
    order = plan.shape.order
    size = _SEGMENT_HEAD_WORDS + 12 * (order + 1)
    for s in range(len(plan.segments)):
        base = _HEAD_WORDS + s * size
        first, origin = f"s{s}_first", f"s{s}_origin"
        words.append(Word(first, f"first temperature of segment {s}", base * _WORD, temperature))
        words.append(
            Word(origin, f"temperature of segment {s} where x = 0", (base + 1) * _WORD, temperature)
        )
        for f in range(12):
            at = base + _SEGMENT_HEAD_WORDS + f * (order + 1)
            words += [_coefficient(plan, s, f, k, (at + k) * _WORD) for k in range(order + 1)]
    return words + _terms(plan, sensor, (_HEAD_WORDS + len(plan.segments) * size) * _WORD)


def _terms(plan: Plan, sensor: TemperatureSensor, offset: int) -> list[Word]:
    """Words of the terms beyond the linear ones, which stand behind the segments."""
    words = []
    if plan.quadratic is not None:
        log2 = quadratic_log2(plan.shape.output_q, plan.shape.output_shift - 32)
        method = Method("QUADRATIC", "quadratic term", "g/g^2", 2.0**-log2, 0.0)
        for name in QUADRATIC_NAMES:
            words.append(Word(f"{name}", f"{name}, quadratic term", offset, method))
            offset += _WORD
    if plan.sensitivity is not None:
        unit, lsb = f"({plan.shape.unit})/g", 2.0 ** -sensitivity_log2(plan)
        method = Method("SENSITIVITY", "subtracted from the rate for 1 g", unit, -lsb, 0.0)
        for name in SENSITIVITY_NAMES:
            words.append(Word(name, f"{name}, g-sensitivity", offset, method))
            offset += _WORD
    if plan.rate is not None:
        step = sensor.degc_per_code * 2.0**-RATE_Q
        fraction = plan.shape.output_q + plan.shape.output_shift - 32
        lsb = plan.rate.gain / step * 2.0 ** -(fraction + 32)
        of_range = Method("RATE_RANGE", "rate of temperature", "K/s", step, 0.0)
        of_offset = Method("RATE_OFFSET", "offset for dT/dt", "g/(K/s)", lsb, 0.0)
        words += [
            Word("rate_min", "lowest rate of the range", offset, of_range),
            Word("rate_max", "highest rate of the range", offset + _WORD, of_range),
        ]
        # The gain, which fixes a format, stands between.
        words += [
            Word(f"r{axis}", f"offset of {axis} for dT/dt", offset + (3 + i) * _WORD, of_offset)
            for i, axis in enumerate(AXES)
        ]
    return words


def _coefficient(plan: Plan, segment: int, function: int, power: int, offset: int) -> Word:
    name = FUNCTION_NAMES[plan.shape.form][function]
    return Word(
        f"s{segment}_{name}_{power}",
        f"{name}, coefficient of x^{power} in segment {segment}",
        offset,
        _method(plan, function, power),
    )


def _method(plan: Plan, function: int, power: int) -> Method:
    unit, lsb, _ = function_format(plan, function)
    is_offset = function % 4 == 3
    slope = lsb / 2.0**power
    centre = 0.5 if power < plan.shape.order else 0.0
    if is_offset and power == 0 and plan.shape.form != INVERSE:
        centre += plan.shape.held_in_offset
    kind = "OFFSET" if is_offset else "GAIN"
    text = f"coefficient of x^{power}"
    return Method(f"{kind}_{power}", text, unit, slope, -centre * slope)
