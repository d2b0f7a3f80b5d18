"""Stray rows of an IMU's log: few rates are lost samples, many rows are numbers of another kind."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.parts import NAMES, Log
from triaxcal.model.types import BoolArray, FloatArray
from triaxcal.readings.evenclock import EvenClock
from triaxcal.readings.strays import STRAYS_MAX, part_of, strays

_NOTHING = 1e-3
_LIKE = 3.0
"""A ratio within this factor of another is taken for it."""


def stray_rows(
    log: Log, places: Mapping[str, slice], values: FloatArray, clock: EvenClock
) -> BoolArray:
    """Rows (n,) whose rates are lost samples. Forces are not: knocks on a table are real.

    Raises
    ------
    RefusedError
        Where the rows are too many for errors of transmission.
    """
    lost = np.zeros(len(values), dtype=bool)
    for name, place in places.items():
        found = strays(values[:, place])
        if found.sum() > STRAYS_MAX * len(values):
            raise _mixed(log, name, values[:, place], found, clock)
        if name == "rate" and not log.increments:
            lost = found
    return lost


def _mixed(
    log: Log, name: str, values: FloatArray, found: BoolArray, clock: EvenClock
) -> RefusedError:
    at, step_s = np.flatnonzero(found), clock.step_s
    part = part_of(values, found)
    hint = f"{part:.3g} of it"
    if abs(part) < _NOTHING * min(step_s, 1.0):
        hint = "nothing: samples that did not arrive?"
    elif 1 / _LIKE < part / step_s < _LIKE:
        hint = f"{part:.3g} of it: increments among instants?"
    elif 1 / _LIKE < part * step_s < _LIKE:
        hint = f"{part:.3g} times it: instants among increments?"
    key = {"rate": "rate_samples", "force": "force_samples", "force2": "force2_columns"}[name]
    return RefusedError(
        log.source,
        f"{len(at)} of {len(values)} rows of the {NAMES[name]} do not fit between the rows before "
        f"and after, the first at {clock.time_s[at[0]]:.6g} s; they read {hint}",
        expected="readings of one kind in all rows",
        remedy=f"correct the log; {key} in [dynamic] holds for every row",
    )
