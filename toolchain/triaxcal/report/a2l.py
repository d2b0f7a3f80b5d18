"""triax_calib.a2l: the constants for XCP tools, as ASAM MCD-2 MC (ASAP2) 1.7.

A CHARACTERISTIC for each word of `triax_calib_t`: the temperature range, where each segment starts
and has its origin, and each coefficient. They stand at SYMBOL_LINK of the constants with their byte
offset; the tool that includes the fragment fills in the address from the linked program's map. The
COMPU_METHODs are linear and give the value that the coefficient of x^k stands for: 1/2 for the
floor after it and the preloaded half LSB of the output are taken off (fixed-point.md).
"""

from __future__ import annotations

from dataclasses import dataclass

from triaxcal import __version__
from triaxcal.codegen.constants import function_format
from triaxcal.codegen.names import names_of
from triaxcal.codegen.templates import environment
from triaxcal.delivery.unit import Delivery
from triaxcal.fixedpoint.formats import FUNCTION_NAMES
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


@dataclass(frozen=True)
class Word:
    """One int32 of `triax_calib_t`."""

    name: str
    text: str
    offset: int
    method: Method


def calib_a2l(delivery: Delivery) -> bytes:
    """Text of the fragment: a project with one module."""
    words = calib_words(delivery)
    context = {
        "version": __version__,
        "inputs": delivery.inputs_sha256[:16],
        "serial": delivery.unit.serial,
        "symbol": f"{names_of(delivery.plan).linked}_calib_constants",
        "words": words,
        "methods": list({w.method.name: w.method for w in words}.values()),
    }
    return environment().get_template("a2l/triax_calib.a2l.j2").render(context).encode()


def calib_words(delivery: Delivery) -> list[Word]:
    """Every adjustable word of the constants; the gains of x, which fix formats, are none."""
    plan, sensor = delivery.plan, delivery.unit.temperature_sensor
    temperature = Method(
        "TRIAX_TEMPERATURE", "temperature code", "degC", sensor.degc_per_code, sensor.degc_at_zero
    )
    words = [
        Word("TRIAX_temp_min", "lowest temperature of the range", 0, temperature),
        Word("TRIAX_temp_max", "highest temperature of the range", _WORD, temperature),
    ]
    order = plan.shape.order
    size = _SEGMENT_HEAD_WORDS + 12 * (order + 1)
    for s in range(len(plan.segments)):
        base = _HEAD_WORDS + s * size
        first, origin = f"TRIAX_s{s}_first", f"TRIAX_s{s}_origin"
        words.append(Word(first, f"first temperature of segment {s}", base * _WORD, temperature))
        words.append(
            Word(origin, f"temperature of segment {s} where x = 0", (base + 1) * _WORD, temperature)
        )
        for f in range(12):
            at = base + _SEGMENT_HEAD_WORDS + f * (order + 1)
            words += [_coefficient(plan, s, f, k, (at + k) * _WORD) for k in range(order + 1)]
    return words + _terms(plan, sensor, (_HEAD_WORDS + len(plan.segments) * size) * _WORD)


def _terms(plan: Plan, sensor: TemperatureSensor, offset: int) -> list[Word]:
    """Words of quadratic terms and of a term in dT/dt, which stand behind the segments."""
    words = []
    if plan.quadratic is not None:
        log2 = quadratic_log2(plan.shape.output_q, plan.shape.output_shift - 32)
        method = Method("TRIAX_QUADRATIC", "quadratic term", "g/g^2", 2.0**-log2, 0.0)
        for name in QUADRATIC_NAMES:
            words.append(Word(f"TRIAX_{name}", f"{name}, quadratic term", offset, method))
            offset += _WORD
    if plan.rate is not None:
        step = sensor.degc_per_code * 2.0**-RATE_Q
        fraction = plan.shape.output_q + plan.shape.output_shift - 32
        lsb = plan.rate.gain / step * 2.0 ** -(fraction + 32)
        of_range = Method("TRIAX_RATE_RANGE", "rate of temperature", "K/s", step, 0.0)
        of_offset = Method("TRIAX_RATE_OFFSET", "offset for dT/dt", "g/(K/s)", lsb, 0.0)
        words += [
            Word("TRIAX_rate_min", "lowest rate of the range", offset, of_range),
            Word("TRIAX_rate_max", "highest rate of the range", offset + _WORD, of_range),
        ]
        # The gain, which fixes a format, stands between.
        words += [
            Word(
                f"TRIAX_r{axis}", f"offset of {axis} for dT/dt", offset + (3 + i) * _WORD, of_offset
            )
            for i, axis in enumerate(AXES)
        ]
    return words


def _coefficient(plan: Plan, segment: int, function: int, power: int, offset: int) -> Word:
    name = FUNCTION_NAMES[plan.shape.form][function]
    return Word(
        f"TRIAX_s{segment}_{name}_{power}",
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
        centre += plan.shape.rounding_in_offset
    kind = "OFFSET" if is_offset else "GAIN"
    text = f"coefficient of x^{power}"
    return Method(f"TRIAX_{kind}_{power}", text, unit, slope, -centre * slope)
