"""Temperatures of a recording's poses: groups of them, the functions they carry, the range."""

from __future__ import annotations

import math

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.thermal.registry import AUTO, THERMAL_FUNCTIONS
from triaxcal.model.thermal.shape import EDGE_DEGC, GROUP_GAP_DEGC, ThermalShape
from triaxcal.model.types import FloatArray
from triaxcal.poses.poseset import PoseSet
from triaxcal.unit.description import UnitDescription

THERMAL_SPREAD_DEGC = 5.0
"""Poses over less than this are at one temperature: an order is not asked of them."""
PARAMETERS_MAX = 4
"""Of a curve of a recording: it has no six positions at each temperature."""
_KELVIN_MIN = 200.0
"""No chamber with an accelerometer in it is as hot in degC, and hardly one as cold in kelvin."""


def temperature_findings(unit: UnitDescription, temps_degc: FloatArray | None) -> list[str]:
    """What a recording's temperatures cannot say of the constants at T0.

    Raises
    ------
    RefusedError
        When the temperatures can only be kelvin.
    """
    t0 = unit.t0_degc
    if temps_degc is None:
        return [
            (
                f"no temperature in the recording: the constants are assumed to be those of T0 = "
                f"{t0:g} degC, and their change with temperature is unknown"
            )
        ]
    low, high = float(temps_degc.min()), float(temps_degc.max())
    if low - EDGE_DEGC <= t0 <= high + EDGE_DEGC:
        return []
    if low > _KELVIN_MIN:
        raise RefusedError(
            f"{unit.source}, [recording] temperature_unit",
            f"poses at {low:.4g} to {high:.4g} degC, and T0 at {t0:g} degC",
            expected="T0 among the poses' temperatures",
            remedy='temperature_unit = "K" if they are kelvin, else state [thermal] t0_degc',
        )
    return [
        (
            f"T0 = {t0:g} degC lies outside of the poses' {low:.4g} to {high:.4g} degC: the "
            "constants there are extrapolated; state [thermal] t0_degc"
        )
    ]


def temperature_groups(temps_degc: FloatArray) -> list[list[int]]:
    """Indices of the poses at each temperature, rising: those within 2 degC of the lowest.

    Not chained: a slow ramp must not become one temperature.
    """
    order = [int(k) for k in np.argsort(temps_degc, kind="stable")]
    groups = [[order[0]]]
    for k in order[1:]:
        if temps_degc[k] - temps_degc[groups[-1][0]] > GROUP_GAP_DEGC:
            groups.append([])
        groups[-1].append(k)
    return groups


def thermal_shapes(
    unit: UnitDescription, temps: FloatArray, temperatures: list[list[int]]
) -> tuple[ThermalShape, ...]:
    """Thermal functions that are tried; the constant alone for one temperature.

    Raises
    ------
    RefusedError
        When unit.toml asks for what the poses' temperatures do not carry.
    """
    choice, t0, where = unit.thermal, unit.t0_degc, f"{unit.source}, [thermal]"
    nested = [f for f in THERMAL_FUNCTIONS if f.nested]
    functions = [f for f in nested if choice.model in (AUTO, f.name)]
    if not functions:
        raise RefusedError(
            f"{where} model",
            f'"{choice.model}" for a recording',
            expected=" or ".join(f'"{name}"' for name in (*(f.name for f in nested), AUTO)),
        )
    tried = [s for f in functions for s in f.candidates(temps, t0)]
    constant = tried[:1]
    asked = () if choice.model == AUTO else functions[0].stated(choice.settings, temps, t0)
    key = f"{where} {', '.join(choice.settings)}"
    most = min(PARAMETERS_MAX, len(temperatures))
    if float(np.ptp(temps)) < THERMAL_SPREAD_DEGC:
        if len(asked) == 1 and asked[0].parameters > 1:
            raise RefusedError(
                key,
                f"{asked[0].detail}, but all {len(temps)} poses are at one temperature "
                f"({temps.min():.4g} to {temps.max():.4g} degC)",
                expected=f"poses over {THERMAL_SPREAD_DEGC:g} degC at least",
                remedy="record poses at more temperatures, or order = 0",
            )
        return tuple(constant)
    if len(asked) != 1:
        more = [s for s in tried if 1 < s.parameters <= most]
        return (*constant, *more)
    if asked[0].parameters > most:
        raise RefusedError(
            key,
            f"{asked[0].detail} with poses at {len(temperatures)} temperature"
            f"{'s' * (len(temperatures) != 1)}",
            expected=f"{asked[0].nested(most).detail} at most",
        )
    return asked


def gain_functions(shape: ThermalShape) -> list[int]:
    """How many functions of a shape the entries of K are tried with; the biases have all."""
    return sorted({1, shape.parameters - 1, shape.parameters} - {0})


def recording_range(
    unit: UnitDescription, poses: PoseSet, temps: FloatArray
) -> tuple[float, float]:
    """Working range: that of the poses, outward to 0.1 degC, or the one stated in unit.toml.

    Raises
    ------
    RefusedError
        When the stated range reaches beyond the poses' temperatures. Without any temperature in
        the recording it is the user's word.
    """
    low, high = float(temps.min()), float(temps.max())
    stated = unit.range_degc
    if stated is None:
        if high - low < 2.0 * EDGE_DEGC:
            middle = (low + high) / 2.0
            low, high = middle - EDGE_DEGC, middle + EDGE_DEGC
        # The 1e-6 forgives the rounding of decimal temperatures.
        return round(math.floor(low * 10.0 + 1e-6) / 10.0, 1), round(
            math.ceil(high * 10.0 - 1e-6) / 10.0, 1
        )
    if poses.temps_degc is not None and (
        stated[0] < low - EDGE_DEGC or stated[1] > high + EDGE_DEGC
    ):
        raise RefusedError(
            f"{unit.source}, [thermal] range_degc",
            f"{stated[0]:g} to {stated[1]:g} degC",
            expected=f"within {EDGE_DEGC:g} degC of the poses' temperatures, {low:.4g} to "
            f"{high:.4g} degC",
            remedy="narrow the range, or record poses further out: nothing is extrapolated",
        )
    return stated
