"""The candidates of poses with known angles: the forms of P0, and all terms with priors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from triaxcal.fitting.recorded.frame import rotation_to, turned_constants
from triaxcal.fitting.recorded.magnitude import fit_scalar
from triaxcal.fitting.recorded.scalar import NINE, scalar_data
from triaxcal.fitting.recorded.temperatures import gain_functions, thermal_shapes
from triaxcal.fitting.recorded.trials import detail
from triaxcal.fitting.table.candidates import TableTrial
from triaxcal.fitting.table.oriented import (
    OrientedFit,
    SerialGrid,
    inverse_linear,
    inverse_quadratic,
)
from triaxcal.model.thermal.shape import ThermalShape
from triaxcal.model.types import FloatArray
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.priors import AUTO, LINEAR, OWN_SQUARES, QUADRATIC_TERMS, Priors

_FORCE, _READINGS = "force from readings", "readings from force"
"""Which side of the equation a fit takes as exact: P0 (12) and (13), or (28) and (29)."""


def trials_of(
    unit: UnitDescription, temps: FloatArray, temperatures: list[list[int]]
) -> list[TableTrial]:
    """What unit.toml asks for and the poses can carry; simpler candidates first.

    Raises
    ------
    RefusedError
        As `thermal_shapes`.
    """
    shapes = thermal_shapes(unit, temps, temperatures)
    priors = _priors(unit)
    if shapes[-1].parameters > 1:
        tried = [trial for shape in shapes for trial in thermal_trials(shape, priors)]
    else:
        tried = one_temperature_trials(shapes[0], priors)
    wanted = {LINEAR: (False,), QUADRATIC_TERMS: (True,), OWN_SQUARES: (True,)}
    terms = unit.firmware_terms if unit.firmware_terms != AUTO else unit.terms
    if terms == OWN_SQUARES:
        tried = [t for t in tried if not t.quadratic or t.priors is not None]
    asked = [t for t in tried if t.quadratic in wanted.get(terms, (False, True))]
    return [t for t in asked if t.parameters <= _most(t, temps)]


def _most(trial: TableTrial, temps: FloatArray) -> int:
    """Parameters that the poses can carry; with priors one value more an axis, for the noise."""
    return 3 * (len(temps) - (trial.priors is not None))


def _priors(unit: UnitDescription) -> Priors:
    """[priors]; a unit whose firmware has own squares alone has no other product."""
    if unit.firmware_terms == OWN_SQUARES:
        return replace(unit.priors, product_g_per_g2=0.0)
    return unit.priors


def one_temperature_trials(shape: ThermalShape, priors: Priors) -> list[TableTrial]:
    """The forms of P0; simpler ones first."""
    return [
        TableTrial(f"linear, {_FORCE}", _FORCE, shape, inverse_linear, 12),
        TableTrial(f"linear, {_READINGS}", _READINGS, shape, _forward, 12),
        TableTrial("nine constants and the turn to the table", "|a| = g", shape, _scalar, 12),
        TableTrial(f"quadratic, {_FORCE}", _FORCE, shape, inverse_quadratic, 27, quadratic=True),
        TableTrial(
            f"quadratic, {_READINGS}", _READINGS, shape, _forward_quadratic, 27, quadratic=True
        ),
        _with_priors(shape, 1, priors, ""),
    ]


def thermal_trials(shape: ThermalShape, priors: Priors) -> list[TableTrial]:
    """The forward form with a thermal function, and K with fewer functions; the same with Q."""
    gains = [(n, f"; {detail(shape, n)}") for n in gain_functions(shape)]
    return [
        *(TableTrial(f"linear, {_READINGS}{d}", _READINGS, shape, None, 0, n) for n, d in gains),
        *(_with_priors(shape, n, priors, d) for n, d in gains),
    ]


def _with_priors(shape: ThermalShape, gains: int, priors: Priors, functions: str) -> TableTrial:
    terms = "all terms" if priors.product_g_per_g2 > 0.0 else "own squares"
    return TableTrial(
        f"{terms} with priors{functions}",
        _FORCE,
        shape,
        None,
        0,
        gains,
        quadratic=True,
        priors=priors,
    )


def _forward(readings: FloatArray, force: FloatArray) -> OrientedFit:
    return SerialGrid.of(force).fit(readings)


def _forward_quadratic(readings: FloatArray, force: FloatArray) -> OrientedFit:
    return SerialGrid.of(force, quadratic=True).fit(readings)


def _scalar(readings: FloatArray, force: FloatArray) -> OrientedFit:
    """|a| = g alone, then turned to the table: what the angles' errors cannot spoil."""
    gravity_g = float(np.linalg.norm(force, axis=1).mean())
    ones = np.ones(len(readings))
    fit = fit_scalar(NINE, scalar_data(readings, ones[:, None], ones, gravity_g), 1)
    found = _oriented(fit.constants()[:, 0], fit.condition)
    rotation = rotation_to(found.force_g(readings), force)
    turned = turned_constants(fit.constants(), rotation)[:, 0]
    return _oriented(turned, fit.condition)


def _oriented(constants: FloatArray, condition: float) -> OrientedFit:
    return OrientedFit(constants[:9].reshape(3, 3), constants[9:], None, condition)
