"""What is wrong with readings that are refused, or that pass with a doubt: the cause, by name."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from triaxcal.base.errors import ContradictionError, RefusedError
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.model.metrological import force_from_voltage, unpack_constants
from triaxcal.model.terms import products
from triaxcal.readings.measurements import MeasurementSet
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.priors import LINEAR

if TYPE_CHECKING:
    from triaxcal.diagnosis.answer import Diagnosis

_SYMPTOMS = ("unknown", "dwells", "curve", "scatter")
"""Causes that say how the readings look: what was advised for them stays."""


def causes_of(
    unit: UnitDescription, measurements: MeasurementSet, calibration: Calibration | None
) -> Diagnosis:
    """Ranked causes of what a calibration leaves: its quadratic terms are no fault.

    Raises
    ------
    RefusedError
        When a test position is missing altogether.
    """
    # Only readings that are refused or doubtful wait for it.
    from triaxcal.diagnosis import diagnose  # noqa: PLC0415

    if calibration is not None:
        measurements = without_quadratic(measurements, calibration)
    return diagnose(unit, measurements)


def without_quadratic(measurements: MeasurementSet, calibration: Calibration) -> MeasurementSet:
    """What a unit without the calibration's quadratic terms would read: U + K Q p(l)."""
    Q = calibration.terms.quadratic_per_g
    if Q is None:
        return measurements
    dwells = []
    for dwell in measurements.dwells:
        constants = calibration.thermal.constants_at(dwell.temp_degc)
        K, _ = unpack_constants(constants)
        linear = force_from_voltage(constants, dwell.voltage_v)
        dwells.append(replace(dwell, voltage_v=dwell.voltage_v + K @ (Q @ products(linear))))
    return replace(measurements, dwells=tuple(dwells))


def with_cause(
    refusal: RefusedError,
    unit: UnitDescription,
    measurements: MeasurementSet,
    calibration: Calibration | None = None,
    *,
    contradiction: bool = False,
) -> RefusedError:
    """The refusal, with the cause that explains the readings best.

    It takes the place of general advice where the readings contradict each other (always with
    `contradiction`), and is added to the advice on rows that are missing or doubled, or where the
    cause is but a symptom. The refusal is as it was where it is not about the readings, or no cause
    is told from a sound unit.
    """
    if not refusal.place.startswith(measurements.source) or refusal.exit_code != 1:
        return refusal
    try:
        found = causes_of(unit, measurements, calibration)
    except (RefusedError, np.linalg.LinAlgError):
        return refusal
    if not found.doubtful:
        return refusal
    remedy = _advice(found, unit)
    symptom = found.answer[0].cause in _SYMPTOMS
    if refusal.remedy and (
        symptom or not (contradiction or isinstance(refusal, ContradictionError))
    ):
        remedy = f"{refusal.remedy}; {remedy}"
    elif _is_about_rows(found, measurements):
        return _at_its_rows(refusal, found, measurements.source)
    return RefusedError(refusal.place, refusal.found, expected=refusal.expected, remedy=remedy)


def _advice(found: Diagnosis, unit: UnitDescription) -> str:
    cause = found.answer[0].cause
    if cause == "unknown":
        return "no cause of the list of `triaxcal diagnose` explains the readings"
    if cause == "own_square" and unit.firmware_terms == LINEAR:
        return f'{found.sentence}; remove [firmware] terms = "linear", which keeps them out'
    return found.sentence


def _is_about_rows(found: Diagnosis, measurements: MeasurementSet) -> bool:
    """Whether one cause is named, and it is about some of the rows."""
    return len(found.answer) == 1 and 0 < len(found.answer[0].rows) < len(measurements.dwells) / 2


def _at_its_rows(refusal: RefusedError, found: Diagnosis, source: str) -> RefusedError:
    """The refusal at the rows that are to blame; where it showed comes after."""
    from triaxcal.diagnosis.core.readings import rows_in_words  # noqa: PLC0415

    rows = rows_in_words(np.array(found.answer[0].rows))
    where = refusal.place.removeprefix(source).lstrip(", ")
    shown = f"{where}: {refusal.found}" if where else refusal.found
    return RefusedError(
        f"{source}, {rows}",
        f"{found.sentence}; it shows at {shown}",
        expected=refusal.expected,
        remedy="correct these rows or measure them again",
    )
