"""triax_calib.h and .c: each constant with its physical value, format and rounding."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from triaxcal.codegen.names import names_of
from triaxcal.codegen.templates import int32_literal, render
from triaxcal.fixedpoint.formats import FUNCTION_NAMES
from triaxcal.fixedpoint.gyro import SENSITIVITY_NAMES, sensitivity_log2
from triaxcal.fixedpoint.plan import Plan
from triaxcal.fixedpoint.quadratic import QUADRATIC_NAMES, quadratic_log2
from triaxcal.fixedpoint.rate import RATE_Q
from triaxcal.model.methods.method import INVERSE
from triaxcal.model.metrological import per
from triaxcal.model.types import FloatArray, IntArray
from triaxcal.unit.thermometer import TemperatureSensor

_DIGITS = 9
CONSTANTS_FILES = ("triax_calib.h", "triax_calib.c")


@dataclass(frozen=True)
class Provenance:
    """What the constants' header says about where they come from.

    Attributes
    ----------
    serial : str
        Serial number of the unit.
    inputs_sha256 : str
        Hash of the unit's files.
    summary : tuple of str
        Lines for readers: method, thermal model, range, limits.
    date : str
        Day of the measurements; "" where it is not stated.
    axes : str
        Columns of raw x, y, z with their signs; "" where the readings have none.
    """

    serial: str
    inputs_sha256: str
    summary: tuple[str, ...]
    date: str = ""
    axes: str = ""

    @property
    def epk(self) -> str:
        """What tells these constants from all others to a calibration tool (ASAP2: EPK)."""
        return f"{self.serial} {self.inputs_sha256[:16]}"


def render_constants(
    plan: Plan, sensor: TemperatureSensor, provenance: Provenance
) -> dict[str, str]:
    """Texts of `CONSTANTS_FILES`, or a gyro's, by name."""
    names = names_of(plan)
    source = f"shape {names.shape}, inputs sha256 {provenance.inputs_sha256[:16]}"
    context = {
        "serial": provenance.serial,
        "epk": provenance.epk,
        "summary": provenance.summary,
        "temp_min": _code(plan.temp_min_code, sensor),
        "temp_max": _code(plan.temp_max_code, sensor),
        "segments": [_segment_context(plan, s, sensor) for s in range(len(plan.segments))],
        "rate": _rate_context(plan, sensor),
        **_terms_context(plan),
        **names.unit_context(provenance.inputs_sha256),
    }
    return dict(render(name, source, names, **context) for name in CONSTANTS_FILES)


def _terms_context(plan: Plan) -> dict[str, Any]:
    """Tables of the terms beyond the linear ones."""
    shape = plan.shape
    of_quadratic = quadratic_log2(shape.output_q, shape.output_shift - 32)
    of_sensitivity = sensitivity_log2(plan)
    quadratic = (plan.quadratic, plan.real_quadratic)
    sensitivity = (plan.sensitivity, plan.real_sensitivity)
    return {
        "quadratic": _table_context(quadratic, QUADRATIC_NAMES, of_quadratic),
        "quadratic_log2": of_quadratic,
        "sensitivity": _table_context(sensitivity, SENSITIVITY_NAMES, of_sensitivity),
        "sensitivity_log2": of_sensitivity,
    }


def _rate_context(plan: Plan, sensor: TemperatureSensor) -> dict[str, Any] | None:
    """The term in dT/dt, or none."""
    if plan.rate is None:
        return None
    rate, shape = plan.rate, plan.shape
    step = sensor.degc_per_code * 2.0**-RATE_Q
    fraction = shape.output_q + shape.output_shift - 32
    lsb = rate.gain / step * 2.0 ** -(fraction + 32)
    return {
        "min": {"code": int32_literal(rate.min_code), "value": f"{rate.min_code * step:.6g}"},
        "max": {"code": int32_literal(rate.max_code), "value": f"{rate.max_code * step:.6g}"},
        "gain": rate.gain,
        "words": [
            _word(f"r{axis}", integer, exact, lsb)
            for axis, integer, exact in zip(
                "xyz", rate.words.tolist(), rate.real.tolist(), strict=True
            )
        ],
    }


def _table_context(
    table: tuple[IntArray | None, FloatArray | None], names: tuple[str, ...], log2: int
) -> list[list[dict[str, str]]]:
    """Words of a table of terms by row, each with its physical value and rounding; or none."""
    words, real = table
    if words is None or real is None:
        return []
    columns = words.shape[1]
    lsb = 2.0**-log2
    shown = [
        _word(name, integer, exact, lsb)
        for name, integer, exact in zip(
            names, words.ravel().tolist(), real.ravel().tolist(), strict=True
        )
    ]
    return [shown[columns * i : columns * (i + 1)] for i in range(3)]


def _word(name: str, integer: int, exact: float, lsb: float) -> dict[str, str]:
    """An integer with its physical value and rounding."""
    return {
        "name": name,
        "integer": int32_literal(integer),
        **_physical(exact * lsb, (integer - exact) * lsb, lsb),
    }


def _physical(value: float, rounding: float, lsb: float) -> dict[str, str]:
    """Value and rounding of an integer, to a quarter of its last place or less.

    The digits behind it differ between versions of the libraries that fitted the value, and the
    text of the C shall not.
    """
    place = math.floor(math.log10(lsb / 4))
    size = math.floor(math.log10(abs(value))) if value else place
    digits = min(_DIGITS, max(1, size - place + 1))
    steps = round(rounding * 10.0**-place)
    return {
        "value": f"{value:.{digits}g}",
        "rounding": f"{steps:+d}e{place}" if steps else "0",
    }


def _code(code: int, sensor: TemperatureSensor) -> dict[str, str]:
    return {"code": int32_literal(code), "degc": f"{sensor.degc(code):.6g}"}


def _segment_context(plan: Plan, s: int, sensor: TemperatureSensor) -> dict[str, Any]:
    segment = plan.segments[s]
    return {
        "first_code": int32_literal(segment.first_code),
        "first_degc": f"{sensor.degc(segment.first_code):.6g}",
        "origin_code": int32_literal(segment.origin_code),
        "origin_degc": f"{sensor.degc(segment.origin_code):.6g}",
        "gain": segment.gain,
        "x_degc": f"{sensor.degc_per_code * 2**31 / segment.gain:.6g}",
        "functions": [_function_context(plan, s, f) for f in range(12)],
    }


def _function_context(plan: Plan, s: int, f: int) -> dict[str, Any]:
    """One function's coefficients with physical value and rounding.

    The value of an integer is what it contributes at x = 1: 1/2 for the floor after it and the
    preloaded half LSB of the output (and 1 for the floors of high words) are taken off before the
    rounding is stated.
    """
    unit, lsb, bits = function_format(plan, f)
    order = plan.shape.order
    preload = plan.shape.held_in_offset if f % 4 == 3 and plan.shape.form != INVERSE else 0
    rows = []
    for k in range(order + 1):
        integer = int(plan.segments[s].coefficients[f, k])
        centre = (0.5 if k < order else 0.0) + (preload if k == 0 else 0)
        exact = float(plan.real[s, f, k])
        rounding = ((integer - centre) / 2.0**k - exact) * lsb
        rows.append(
            {
                "integer": int32_literal(integer),
                **_physical(exact * lsb, rounding, lsb / 2.0**k),
            }
        )
    notes = f"integer_k in 2^-({bits} + k) {_raw_unit(plan, f)}"
    if preload:
        notes += f", {preload} of integer_0 is rounding"
    return {
        "name": FUNCTION_NAMES[plan.shape.form][f],
        "unit": unit,
        "value": f"{float(plan.real[s, f, 0]) * lsb:.9g}",
        "format": notes,
        "coefficients": rows,
    }


def function_format(plan: Plan, f: int) -> tuple[str, float, int]:
    """Physical unit of a function, its last place in that unit, and its Q in `_raw_unit`."""
    shape, reading = plan.shape, plan.reading
    unit = shape.unit
    gain = f % 4 < 3
    if shape.inverse is not None:
        bits = shape.inverse.scale_log2 - shape.output_q - shape.output_shift if gain else 0
        return (per(reading, unit) if gain else reading, 2.0**-bits * plan.volts_per_lsb, bits)
    bits = shape.output_q + shape.output_shift - (0 if gain else 32)
    return (
        per(unit, reading) if gain else unit,
        2.0**-bits / (plan.volts_per_lsb if gain else 1.0),
        bits,
    )


def _raw_unit(plan: Plan, f: int) -> str:
    """Unit of the integer; code32 is a raw code left-justified to 32 bits."""
    gain = f % 4 < 3
    unit = f"({plan.shape.unit})" if plan.shape.gyro else "g"
    if plan.shape.form == INVERSE:
        return f"code32/{unit}" if gain else "code32"
    return f"{unit}/code32" if gain else plan.shape.unit
