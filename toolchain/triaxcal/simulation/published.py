"""Measurements that a published table of constants stands for, computed through P1 (9)."""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import Layout, read_tables
from triaxcal.model.metrological import CONSTANT_NAMES
from triaxcal.model.positions import TEST_POSITIONS
from triaxcal.readings.measurements import MEASUREMENTS_FILE, write_measurements
from triaxcal.unit.description import PLAUSIBLE_DEGC, UnitDescription

FORMAT = 1
TABLES_FILE = "tables.toml"
_LAYOUT: Layout = {
    "": {"format": True, "source": True},
    "constants": {"temp_degc": True, **dict.fromkeys(CONSTANT_NAMES, True)},
}


def write_published_measurements(folder: Path, unit: UnitDescription) -> Path:
    """Write measurements.csv of the constants in tables.toml; returns its path.

    U = K a + U0 for the six test positions at each temperature of the table, in decimal
    arithmetic: not one digit is lost, and P1 (10) gives the table back to its last digit.

    Raises
    ------
    RefusedError
        When tables.toml is missing or wrong, or the unit's local gravity is not 1 g, in which
        K (V/g) is printed.
    """
    tables = read_tables(folder / TABLES_FILE, _LAYOUT, FORMAT)
    if unit.gravity_g != 1.0:
        raise RefusedError(
            f"{folder / 'unit.toml'}, [site] local_gravity_m_per_s2",
            f"{unit.gravity_g:.9g} g",
            expected="9.80665, for measurements computed at a = 1 g",
        )
    constants = tables["constants"]
    temps_degc = constants.rising("temp_degc", *PLAUSIBLE_DEGC, range(1, 65))
    columns = [constants.decimals(name, len(temps_degc)) for name in CONSTANT_NAMES]
    rows = [
        (position, f"{temp:g}", *(format(u, "f") for u in _voltage_v(list(values), position)))
        for temp, values in zip(temps_degc, zip(*columns, strict=True), strict=True)
        for position in TEST_POSITIONS
    ]
    target = folder / MEASUREMENTS_FILE
    comments = (
        f"Computed from {TABLES_FILE} by U = K a + U0 with |a| = 1 g; nothing here was measured.",
        f"Source of the constants: {' '.join(tables[''].text('source').split())}",
    )
    write_measurements(target, ("position", "temp_degc", "ux_v", "uy_v", "uz_v"), rows, comments)
    return target


def _voltage_v(constants: list[Decimal], position: str) -> list[Decimal]:
    """Outputs of x, y, z in V at 1 g, P1 (9); constants in the order of `CONSTANT_NAMES`."""
    force = TEST_POSITIONS[position]
    return [
        sum((constants[3 * i + j] * force[j] for j in range(3)), constants[9 + i]) for i in range(3)
    ]
