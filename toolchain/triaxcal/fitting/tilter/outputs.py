"""Mistakes of whole outputs or rows before any fit: a dead or copied output, mistaken units."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.tilter.estimators import DEAD_OUTPUT
from triaxcal.model.positions import AXES
from triaxcal.readings.measurements import Dwell, MeasurementSet

_COPY = 1e-6
"""Share of an output's span by which its copy differs at most: the rounding of a file."""


def refuse_silent_outputs(measurements: MeasurementSet, reading_unit: str = "V") -> None:
    """Refuse an output that does not change, or that repeats another one.

    `reading_unit` is that of the readings.

    Raises
    ------
    RefusedError
        Naming the output.
    """
    readings = np.array([d.voltage_v for d in measurements.dwells])
    spans = readings.max(axis=0) - readings.min(axis=0)
    liveliest = int(spans.argmax())
    expected = "three outputs, each following the force along an axis of its own"
    remedy = "check the wiring and the columns of the readings"
    for i in np.flatnonzero(spans <= DEAD_OUTPUT * spans[liveliest]).tolist():
        raise RefusedError(
            measurements.source,
            f"U{AXES[i]} does not respond to gravity: it stays within "
            f"{_size(spans[i], reading_unit, 3)} in all dwells, while U{AXES[liveliest]} changes "
            f"by {_size(spans[liveliest], reading_unit, 4)}",
            expected=expected,
            remedy=remedy,
        )
    for i, j in combinations(range(3), 2):
        for sign, word in ((1.0, "repeats"), (-1.0, "is the negative of")):
            if np.ptp(readings[:, j] - sign * readings[:, i]) <= _COPY * spans[i]:
                raise RefusedError(
                    measurements.source,
                    f"U{AXES[j]} {word} U{AXES[i]} in all dwells",
                    expected=expected,
                    remedy=remedy,
                )


def refuse_mistaken_units(measurements: MeasurementSet) -> None:
    """Refuse rows whose readings are about a thousand times those of the others, or a thousandth.

    The length of (Ux, Uy, Uz) is of one size in every position; the median gives it. Within a
    factor of ten of a thousand is near enough: nothing but a mistaken unit is in that window.

    Raises
    ------
    RefusedError
        Naming the rows.
    """
    dwells = measurements.dwells
    lengths = np.array([float(np.linalg.norm(d.voltage_v)) for d in dwells])
    typical = float(np.sort(lengths)[(len(lengths) - 1) // 2])
    if typical == 0.0:
        return
    ratios = lengths / typical
    for low, high, text in ((1e2, 1e4, "1000 times"), (1e-4, 1e-2, "1/1000 of")):
        odd = [d for d, r in zip(dwells, ratios, strict=True) if low < r < high]
        if odd:
            temps = sorted({d.temp_degc for d in odd})
            raise RefusedError(
                f"{measurements.source}, {_rows(odd)}",
                f"readings at {_temps(temps)} degC are about {text} those of the other rows",
                expected="one unit throughout",
                remedy="V taken for mV, or mV for V? convert these rows",
            )


def _size(value: float, unit: str, digits: int) -> str:
    return f"{value * 1e3:.{digits}g} mV" if unit == "V" else f"{value:.{digits}g} {unit}"


def _temps(temps: list[float]) -> str:
    return ", ".join(f"{t:.6g}" for t in temps)


def _rows(dwells: list[Dwell]) -> str:
    rows = [str(d.row) for d in sorted(dwells, key=lambda d: d.row)]
    return f"row {rows[0]}" if len(rows) == 1 else "rows " + ", ".join(rows)
