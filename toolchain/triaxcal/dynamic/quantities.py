"""Columns of [dynamic] as quantities in SI units, and what their counts are counted from."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import Values
from triaxcal.base.kinds import word
from triaxcal.base.tomltable import shown
from triaxcal.dynamic.columns import DynamicTable
from triaxcal.dynamic.recording import INCREMENT
from triaxcal.dynamic.scales import (
    ANGLE_UNITS,
    COUNT,
    FORCE_UNITS,
    RATE_UNITS,
    VELOCITY_UNITS,
)
from triaxcal.model.types import FloatArray
from triaxcal.readings.table import Quantity, ReadTable, signed
from triaxcal.readings.units import to_degc
from triaxcal.unit.recordingfile import ClockLayout, Column, FileLayout

FORCES = ("force", "force2")
"""Quantities that may have a file, or times, of their own."""
BITS = range(8, 33)
"""Widths of raw counts."""


@dataclass(frozen=True)
class ForcesApart:
    """Accelerometers with a file, or a column of times, of their own.

    Attributes
    ----------
    file : str or None
        None where it is the recording's.
    layout : FileLayout
    clock : ClockLayout
    """

    file: str | None
    layout: FileLayout
    clock: ClockLayout


def forces_apart(found: DynamicTable, clock: ClockLayout) -> ForcesApart | None:
    """What the accelerometers have of their own; None where it is nothing."""
    if found.force_recording is None and not found.force_time_column:
        return None
    times = found.force_time_column or found.time_column
    triads = (*found.force_columns, *(found.force2_columns or ()))
    layout = found.layout("dynamic", [*times, *(c.column for c in triads)])
    return ForcesApart(found.force_recording, layout, replace(clock, columns=times))


def offsets_of(table: ReadTable, quantities: tuple[Quantity, ...]) -> dict[str, FloatArray]:
    """What counts are counted from, in SI units, of triads whose counts have no sign.

    A triad that was turned has readings of both signs on each axis. Counts that are never negative
    are therefore counted from the middle of their range.
    """
    found = {}
    for quantity in (q for q in quantities if q.unit == COUNT):
        place, factor = table.columns[quantity.name], quantity.convert(np.ones((1, 3)))[0]
        raw = np.stack([table.low[place], table.high[place]]) / factor
        largest = float(raw.max())
        bits = next((k for k in BITS if largest < 2**k), None)
        if bits is not None and raw.min() >= 0.0 and largest > 2.0 ** (bits - 1):
            found[quantity.name] = factor * 2.0 ** (bits - 1)
    return found


def offset_words(offsets: Mapping[str, FloatArray], quantities: tuple[Quantity, ...]) -> list[str]:
    """What was taken off, for the report."""
    words = []
    for quantity in (q for q in quantities if q.name in offsets):
        counts = abs(float(offsets[quantity.name][0] / quantity.convert(np.ones((1, 3)))[0, 0]))
        words.append(
            f"{quantity.key}: counts without sign, {counts:.0f} is taken off as the middle of the "
            "range"
        )
    return words


def quantities_of(values: Values, found: DynamicTable) -> tuple[Quantity, ...]:
    """Columns by the names of `ImuSamples`, and their conversion to SI units.

    Raises
    ------
    RefusedError
        For a unit of increments where instants are read, and the other way round; for counts
        without their size, and a size without counts.
    """
    rate_units = ANGLE_UNITS if found.rate_samples == INCREMENT else RATE_UNITS
    force_units = VELOCITY_UNITS if found.force_samples == INCREMENT else FORCE_UNITS
    for name, units in (("rate_unit", rate_units), ("force_unit", force_units)):
        if values.given[name] not in units:
            raise values.refuse(name, word(tuple(units)).expected)
    rate_scale, force_scale = rate_units[found.rate_unit], force_units[found.force_unit]
    if _counts(values, "rate", "rate_counts_per_deg_per_s"):
        rate_scale = RATE_UNITS["deg/s"] / (found.rate_counts_per_deg_per_s or math.nan)
    if _counts(values, "force", "force_counts_per_g"):
        force_scale = FORCE_UNITS["g"] / (found.force_counts_per_g or math.nan)
    quantities = [
        signed("rate", "rate_columns", found.rate_columns, rate_scale),
        signed("force", "force_columns", found.force_columns, force_scale),
    ]
    if found.force2_columns is not None:
        quantities.append(signed("force2", "force2_columns", found.force2_columns, force_scale))
    degc = to_degc(found.temperature_unit)
    for name, key, temp in (
        ("temp_degc", "temp_column", found.temp_column),
        ("gyro_temp_degc", "gyro_temp_column", found.gyro_temp_column),
    ):
        if temp is not None:
            quantities.append(Quantity(name, key, (temp,), degc))
    if found.table_angle_column is not None:
        column = (found.table_angle_column,)
        quantities.append(Quantity("table_angle_rad", "table_angle_column", column, np.radians))
    counted = {"rate_columns": found.rate_unit, "force_columns": found.force_unit}
    counted["force2_columns"] = found.force_unit
    return tuple(
        replace(q, apart=True, unit=COUNT if counted.get(q.key) == COUNT else "")
        for q in quantities
    )


def _counts(values: Values, triad: str, size: str) -> bool:
    """Whether a triad is in counts; `size` is the key of their size."""
    counts = values.given[f"{triad}_unit"] == COUNT
    if counts == (size in values):
        return counts
    if counts:
        raise RefusedError(
            values.where(f"{triad}_unit"),
            f'"{COUNT}" and no {size}',
            expected=f"{size}: the nominal size, from the data sheet",
        )
    raise RefusedError(
        values.where(size),
        f"given, and {triad}_unit is {shown(values.given[f'{triad}_unit'])}",
        expected=f'{triad}_unit = "{COUNT}", or no {size}',
    )


def names_of(found: DynamicTable) -> list[Column]:
    """Columns, single or in triads."""
    triads = (*found.rate_columns, *found.force_columns, *(found.force2_columns or ()))
    single = (found.temp_column, found.gyro_temp_column, found.table_angle_column)
    return [*found.time_column, *(c.column for c in triads), *(c for c in single if c is not None)]
