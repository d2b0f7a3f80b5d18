"""Measurements that a published table of constants stands for, computed through P1 (9)."""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import FORMAT, FileKeys, Key, TableKeys
from triaxcal.base.kinds import TEXT, decimal, listed, rising
from triaxcal.model.metrological import CONSTANT_NAMES
from triaxcal.model.positions import TEST_POSITIONS
from triaxcal.model.thermal.shape import PLAUSIBLE_DEGC
from triaxcal.readings.measurements import MEASUREMENTS_FILE, write_measurements
from triaxcal.unit.description import UnitDescription

TABLES_FILE = "tables.toml"
SOURCE = Key("source", TEXT, "Where the numbers were published.", example='"A book, page 1"')
TEMPERATURES = Key(
    "temp_degc",
    rising(*PLAUSIBLE_DEGC, 1, 64),
    "Temperatures of the table.",
    unit="degC",
    example="[20]",
)
_CURVE = listed(decimal(), range(1, 65), "a list of numbers, one for each temperature")
CONSTANTS = tuple(
    Key(
        name,
        _CURVE,
        f"{name} at each temperature.",
        unit="V" if name.startswith("U0") else "V/g",
        example="[0.5]" if name in ("Kxx", "Kyy", "Kzz") else "[0]",
    )
    for name in CONSTANT_NAMES
)
TABLES = FileKeys(
    TABLES_FILE,
    "Published constants to turn into readings",
    (
        TableKeys("", "", (FORMAT, SOURCE)),
        TableKeys("constants", "The constants as printed.", (TEMPERATURES, *CONSTANTS)),
    ),
)


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
    tables = TABLES.read(folder / TABLES_FILE)
    if unit.gravity_g != 1.0:
        raise RefusedError(
            f"{folder / 'unit.toml'}, [site] local_gravity_m_per_s2",
            f"{unit.gravity_g:.9g} g",
            expected="9.80665, for measurements computed at a = 1 g",
        )
    constants = tables["constants"]
    temps_degc = constants[TEMPERATURES]
    columns = [constants[key] for key in CONSTANTS]
    for key, column in zip(CONSTANTS, columns, strict=True):
        if len(column) != len(temps_degc):
            raise constants.refuse(key.name, f"a list of {len(temps_degc)} numbers")
    rows = [
        (position, f"{temp:g}", *(format(u, "f") for u in _voltage_v(list(values), position)))
        for temp, values in zip(temps_degc, zip(*columns, strict=True), strict=True)
        for position in TEST_POSITIONS
    ]
    target = folder / MEASUREMENTS_FILE
    comments = (
        f"Computed from {TABLES_FILE} by U = K a + U0 with |a| = 1 g; nothing here was measured.",
        f"Source of the constants: {' '.join(tables[''][SOURCE].split())}",
    )
    write_measurements(target, ("position", "temp_degc", "ux_v", "uy_v", "uz_v"), rows, comments)
    return target


def _voltage_v(constants: list[Decimal], position: str) -> list[Decimal]:
    """Outputs of x, y, z in V at 1 g, P1 (9); constants in the order of `CONSTANT_NAMES`."""
    force = TEST_POSITIONS[position]
    return [
        sum((constants[3 * i + j] * force[j] for j in range(3)), constants[9 + i]) for i in range(3)
    ]
