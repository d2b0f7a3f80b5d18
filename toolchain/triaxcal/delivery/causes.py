"""What is wrong with readings that are refused, or that pass with a doubt: the cause, by name."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from triaxcal.base.errors import ContradictionError, RefusedError
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.core.grouping import group_dwells
from triaxcal.fitting.tilter.acceptance import dwell_errors_g, dwells_in_range
from triaxcal.fitting.tilter.contradiction import contradiction
from triaxcal.fitting.tilter.squares import straight
from triaxcal.model.metrological import force_from_voltage, unpack_constants
from triaxcal.model.terms import products
from triaxcal.readings.measurements import MeasurementSet
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.priors import LINEAR

if TYPE_CHECKING:
    from triaxcal.diagnosis.answer import Diagnosis

DOUBT = 0.5
"""Of a limit: beyond it readings that pass are doubtful, and their causes are ranked."""
CERTAIN = 20.0
"""Ln of the odds of a fault against a sound unit; those of sound units are below 0 in 99 of 100."""
_USUAL_PARAMETERS = 4
"""Of a curve: a cubic follows the sensors that are known."""


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
    from triaxcal.diagnosis.ranking import TOGETHER  # noqa: PLC0415

    found = diagnose(unit, measurements)
    if calibration is None or calibration.terms.quadratic_per_g is None:
        return found
    # Squares that were fitted can be what a fault looks like: a converter at its end.
    fault = bool(found.answer) and found.answer[0].spoils and found.answer[0].cause != TOGETHER
    return found if fault else diagnose(unit, without_quadratic(measurements, calibration))


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


def refuse_certain_fault(
    unit: UnitDescription, measurements: MeasurementSet, calibration: Calibration
) -> None:
    """Refuse readings within the limits that a fault explains beyond doubt.

    Curves through all temperatures follow a fault as well, and the outer temperatures are never
    held out. So the causes are ranked where readings are doubtful: an error, or the whole of a
    held-out one, beyond half the limit, dwells that contradict others, curves of as many parameters
    as few sound sensors need, or own-axis squares beyond the limit. Curves through all
    temperatures, which nothing held out has tested, are doubted for wrong labels only.

    Raises
    ------
    RefusedError
        Where `is_certain_fault` of the limit over the range.
    """
    doubtful = _doubtful(unit, measurements, calibration)
    untested = 1 < len(calibration.points) <= calibration.shape.parameters
    if not (doubtful or untested):
        return
    try:
        found = causes_of(unit, measurements, calibration)
    except (RefusedError, np.linalg.LinAlgError):
        return
    if not is_certain_fault(found, unit.limits.over_range_g):
        return
    if not doubtful and any(s.amplitudes for s in found.answer):
        return  # an amount is what strongly bent curves look like as well
    refusal = RefusedError(
        measurements.source,
        "residuals and held-out errors are within the limits nevertheless",
        expected="readings of which no fault is more probable than a sound unit",
    )
    if _is_about_rows(found, measurements):
        raise _at_its_rows(refusal, found, measurements.source)
    raise RefusedError(
        refusal.place, refusal.found, expected=refusal.expected, remedy=_advice(found, unit)
    )


def is_certain_fault(found: Diagnosis, limit_g: float) -> bool:
    """Whether readings have a fault that spoils constants by more than a limit.

    The odds against a sound unit are beyond `CERTAIN`, and the readings leave no other cause: each
    one of the answer spoils constants, and is larger than the limit.
    """
    if not found.answer or found.answer[0].log_evidence < CERTAIN:
        return False
    return all(
        s.spoils and max((a.moves_g for a in s.amplitudes), default=np.inf) > limit_g
        for s in found.answer
    )


def _doubtful(
    unit: UnitDescription, measurements: MeasurementSet, calibration: Calibration
) -> bool:
    dwells = dwells_in_range(unit, calibration.range_degc, measurements)
    errors = dwell_errors_g(unit, calibration, dwells)
    limits = np.array([unit.limits.at(d.temp_degc, unit.t0_degc)[0] for d in dwells])
    test = calibration.held_out
    held_out = 0.0 if test is None or test.worst is None else abs(test.worst.error_g)
    groups = group_dwells(measurements, unit.t0_degc)
    Q = calibration.terms.quadratic_per_g
    return bool(
        (errors > DOUBT * limits).any()
        or held_out > DOUBT * unit.limits.over_range_g
        or contradiction(unit, straight(groups, calibration.terms, unit.gravity_g))
        or calibration.shape.parameters > _USUAL_PARAMETERS
        or (Q is not None and np.abs(Q).max() > unit.limits.over_range_g)
    )


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
    is clearly more probable than a sound unit.
    """
    if not refusal.place.startswith(measurements.source) or refusal.exit_code != 1:
        return refusal
    try:
        found = causes_of(unit, measurements, calibration)
    except (RefusedError, np.linalg.LinAlgError):
        return refusal
    if not found.clear:
        return refusal
    remedy = _advice(found, unit)
    symptom = found.answer[0].symptom
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
    shown = f"it shows at {where}: {refusal.found}" if where else refusal.found
    return RefusedError(
        f"{source}, {rows}",
        f"{found.sentence}; {shown}",
        expected=refusal.expected,
        remedy="correct these rows or measure them again",
    )
