"""Temperatures of a recording's poses: groups of them, the orders they carry, the range."""

from __future__ import annotations

import math

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.grouping import GROUP_GAP_DEGC
from triaxcal.fitting.core.thermal import EDGE_DEGC, POLYNOMIAL
from triaxcal.model.types import FloatArray
from triaxcal.poses.poses import PoseSet
from triaxcal.unit.description import UnitDescription

THERMAL_SPREAD_DEGC = 5.0
"""Poses over less than this are at one temperature: an order is not asked of them."""
ORDER_MAX = 3
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
                f"no temperature in the recording: the constants are taken as those of T0 = "
                f"{t0:g} degC, and nothing shows how they change"
            )
        ]
    low, high = float(temps_degc.min()), float(temps_degc.max())
    if low - EDGE_DEGC <= t0 <= high + EDGE_DEGC:
        return []
    if low > _KELVIN_MIN:
        raise RefusedError(
            f"{unit.name}/unit.toml, [recording] temperature_unit",
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


def thermal_orders(
    unit: UnitDescription, temps: FloatArray, temperatures: list[list[int]]
) -> tuple[int, ...]:
    """Orders of the polynomials in temperature that are tried: 0 for one temperature.

    Raises
    ------
    RefusedError
        When unit.toml asks for what the poses' temperatures do not carry.
    """
    asked = unit.thermal.order
    where = f"{unit.name}/unit.toml, [thermal]"
    if unit.thermal.model not in ("auto", POLYNOMIAL):
        raise RefusedError(
            f"{where} model",
            f'"{unit.thermal.model}" for a recording',
            expected='"polynomial" or "auto"',
        )
    if float(np.ptp(temps)) < THERMAL_SPREAD_DEGC:
        if asked:
            raise RefusedError(
                f"{where} order",
                f"order {asked}, but all {len(temps)} poses are at one temperature "
                f"({temps.min():.4g} to {temps.max():.4g} degC)",
                expected=f"poses over {THERMAL_SPREAD_DEGC:g} degC at least",
                remedy="record poses at more temperatures, or order = 0",
            )
        return (0,)
    highest = min(ORDER_MAX, len(temperatures) - 1)
    if asked and asked > highest:
        raise RefusedError(
            f"{where} order",
            f"order {asked} with poses at {len(temperatures)} temperature"
            f"{'s' * (len(temperatures) != 1)}",
            expected=f"{highest} at most",
        )
    return (asked,) if asked else tuple(range(highest + 1))


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
            f"{unit.name}/unit.toml, [thermal] range_degc",
            f"{stated[0]:g} to {stated[1]:g} degC",
            expected=f"within {EDGE_DEGC:g} degC of the poses' temperatures, {low:.4g} to "
            f"{high:.4g} degC",
            remedy="narrow the range, or record poses further out: nothing is extrapolated",
        )
    return stated
