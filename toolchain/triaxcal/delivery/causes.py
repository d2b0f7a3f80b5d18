"""What is wrong with readings that are refused, or that pass with a doubt: the cause, by name."""

from __future__ import annotations

import numpy as np

from triaxcal.base.errors import ContradictionError, RefusedError
from triaxcal.readings.measurements import MeasurementSet
from triaxcal.unit.description import UnitDescription


def with_cause(
    refusal: RefusedError,
    unit: UnitDescription,
    measurements: MeasurementSet,
    *,
    contradiction: bool = False,
) -> RefusedError:
    """The refusal, with the cause that explains the readings best.

    It takes the place of general advice where the readings contradict each other (always with
    `contradiction`), and is added to
    the advice on rows that are missing or doubled. The refusal is as it was where it is not about
    the readings, or no cause is more probable than a sound unit.
    """
    if not refusal.place.startswith(measurements.source) or refusal.exit_code != 1:
        return refusal
    # Only readings that are refused wait for it.
    from triaxcal.diagnosis import diagnose  # noqa: PLC0415

    try:
        found = diagnose(unit, measurements)
    except (RefusedError, np.linalg.LinAlgError):
        return refusal
    if not found.doubtful:
        return refusal
    remedy = found.sentence
    if not (contradiction or isinstance(refusal, ContradictionError)):
        remedy = f"{refusal.remedy}; {remedy}"
    return RefusedError(refusal.place, refusal.found, expected=refusal.expected, remedy=remedy)
