"""Temperatures that no accelerometer is calibrated at: a wrong unit, a lost sign of a byte.

Electronic accelerometers are rated from -55 to 125 degC at most. A dwell outside
`BELIEVED_DEGC` is believed only where [thermal] range_degc names such a temperature. Which mistake
it is shows in which conversions bring it back.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.temperatures import MISTAKES
from triaxcal.model.types import FloatArray
from triaxcal.readings.measurements import Dwell, MeasurementSet
from triaxcal.unit.description import UnitDescription

BELIEVED_DEGC = (-60.0, 130.0)


def refuse_unbelievable_temperatures(unit: UnitDescription, measurements: MeasurementSet) -> None:
    """Refuse dwells at temperatures at which no such sensor is measured.

    Raises
    ------
    RefusedError
        Naming rows, temperatures, and the mistakes that explain all of them.
    """
    low, high = BELIEVED_DEGC
    if unit.range_degc is not None:
        low, high = min(low, unit.range_degc[0] - 2.0), max(high, unit.range_degc[1] + 2.0)
    odd = [d for d in measurements.dwells if not low <= d.temp_degc <= high]
    if not odd:
        return
    temps = np.array([d.temp_degc for d in odd])
    causes = [
        f"{name}: {_temps(convert(temps))} degC"
        for name, convert in MISTAKES.items()
        if all(low <= t <= high for t in convert(temps))
    ]
    remedy = "correct them; if they are right, state [thermal] range_degc with them in it"
    if causes:
        remedy = f"{', or '.join(causes)}? {remedy}"
    raise RefusedError(
        f"{measurements.source}, {_rows(odd)}",
        f"dwells at {_temps(temps)} degC",
        expected=f"temperatures from {low:g} to {high:g} degC, where such sensors work",
        remedy=remedy,
    )


def _temps(temps_degc: FloatArray) -> str:
    """Temperatures to 1 degC, each once."""
    return ", ".join(f"{t:g}" for t in np.unique(np.rint(temps_degc) + 0.0))


def _rows(dwells: Sequence[Dwell]) -> str:
    rows = sorted(d.row for d in dwells)
    if len(rows) == 1:
        return f"row {rows[0]}"
    if rows == list(range(rows[0], rows[-1] + 1)):
        return f"rows {rows[0]} to {rows[-1]}"
    return "rows " + ", ".join(map(str, rows))
