"""One unit's measurements -> its calibration."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.calibration import (
    Calibration,
    CalibrationPoint,
    CheckResult,
    Selection,
)
from triaxcal.fitting.core.grouping import (
    GroupedReadings,
    TemperatureGroup,
    check_position_dwells,
    group_dwells,
    grouped_readings,
)
from triaxcal.fitting.core.judged import OwnSquares
from triaxcal.fitting.core.recorded import PairTerms
from triaxcal.fitting.tilter.contradiction import contradiction
from triaxcal.fitting.tilter.curves import (
    TilterData,
    fit_curves,
    parameter_covariance,
    shifted_voltage,
)
from triaxcal.fitting.tilter.estimators import (
    constants_covariance,
    constants_of,
    design_matrix,
    estimator_operators,
    pooled_variance,
    refuse_ill_conditioned,
)
from triaxcal.fitting.tilter.heldout import check_errors, held_out_test
from triaxcal.fitting.tilter.mounting import turned_notes, unequal_notes
from triaxcal.fitting.tilter.outputs import refuse_mistaken_units, refuse_silent_outputs
from triaxcal.fitting.tilter.plausibility import refuse_exchanged_positions
from triaxcal.fitting.tilter.range import working_range
from triaxcal.fitting.tilter.resolution import code_notes
from triaxcal.fitting.tilter.runs import repeatability, run_notes
from triaxcal.fitting.tilter.selection import PREFERENCE, select
from triaxcal.fitting.tilter.sensitivity import refuse_other_sensitivity
from triaxcal.fitting.tilter.squares import (
    judged_by_checks,
    own_squares,
    square_notes,
    straight,
    with_squares,
)
from triaxcal.fitting.tilter.temperatures import refuse_unbelievable_temperatures
from triaxcal.model.metrological import force_from_voltage
from triaxcal.model.terms import NO_TERMS, Terms
from triaxcal.model.thermal.registry import AUTO, THERMAL_FUNCTIONS
from triaxcal.model.thermal.shape import ThermalShape
from triaxcal.model.types import FloatArray
from triaxcal.readings.measurements import Dwell, MeasurementSet
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.gravity import gravity_notes


def calibrate(
    unit: UnitDescription, measurements: MeasurementSet, pair: PairTerms | None = None
) -> Calibration:
    """Fit the constants at each temperature, choose thermal function and estimator, fit curves.

    The products of two axes that a `pair` has shown vanish in the six positions, and act in the
    check dwells.

    Raises
    ------
    RefusedError
        When the measurements are incomplete, contradict themselves or the unit's description, or
        do not determine what it asks for.
    """
    terms = NO_TERMS if pair is None else Terms(pair.quadratic)
    refuse_unbelievable_temperatures(unit, measurements)
    groups = group_dwells(measurements, unit.t0_degc)
    reading = unit.reading_unit
    refuse_silent_outputs(measurements, reading)
    refuse_mistaken_units(measurements)
    signs = unit.polarity, unit.nominal_v_per_g
    refuse_exchanged_positions(measurements.source, groups, *signs, reading)
    _refuse_singular(measurements.source, groups, unit.gravity_g)
    refuse_other_sensitivity(unit, measurements.source, groups)
    squares = own_squares(unit, groups)
    linear = _fit(unit, measurements, groups, pair, terms)
    if not squares.included:
        return _with_squares(linear, squares)
    terms = with_squares(terms, squares)
    straightened = _fit(unit, measurements, straight(groups, terms, unit.gravity_g), pair, terms)
    squares = judged_by_checks(squares, linear, straightened)
    return _with_squares(straightened if squares.included else linear, squares)


def _with_squares(found: Calibration, squares: OwnSquares) -> Calibration:
    return replace(found, squares=squares, notes=(*square_notes(squares), *found.notes))


def _fit(
    unit: UnitDescription,
    measurements: MeasurementSet,
    groups: tuple[TemperatureGroup, ...],
    pair: PairTerms | None,
    terms: Terms,
) -> Calibration:
    """Curves and estimator of groups whose readings are those of a linear unit."""
    range_degc = working_range(unit, groups)
    readings = grouped_readings(groups, unit.adc.volts_per_code)
    estimators = PREFERENCE if unit.estimator == "auto" else (unit.estimator,)
    operators = [
        estimator_operators(e, unit.gravity_g, readings.variance_v2, len(groups))
        for e in estimators
    ]
    data = TilterData(readings, np.stack(operators), unit.gravity_g)
    checks = check_position_dwells(measurements)
    selection = _select(unit, data, estimators, checks, terms)
    chosen = data.only(estimators.index(selection.estimator))
    found = _calibration(unit, measurements, chosen, selection, range_degc, terms=terms)
    of_pair = () if pair is None else pair.findings
    runs = repeatability(unit, found.thermal, groups)
    return replace(
        found,
        pair=pair,
        notes=(
            *contradiction(unit, groups),
            *run_notes(runs),
            *gravity_notes(unit.gravity_difference_m_per_s2),
            *turned_notes(found.thermal.constants_at(unit.t0_degc)),
            *_unequal(unit, found),
            *code_notes(unit, found, measurements),
            *of_pair,
        ),
        runs=runs,
        held_out=held_out_test(chosen, selection.shape, groups, checks),
    )


def _unequal(unit: UnitDescription, found: Calibration) -> tuple[str, ...]:
    if unit.nominal_v_per_g is not None:
        return ()
    notes = unequal_notes(found.thermal.constants_at(unit.t0_degc))
    if unit.recording is not None:
        return notes
    return tuple(f"{n}; if it is meant, state [sensor] nominal_v_per_g" for n in notes)


def _select(
    unit: UnitDescription,
    data: TilterData,
    estimators: tuple[str, ...],
    checks: tuple[Dwell, ...],
    terms: Terms,
) -> Selection:
    shapes = candidate_shapes(unit, data.readings.temps_degc)
    asked_for = unit.thermal.model != AUTO and len(shapes) == 1
    return select(
        data,
        estimators,
        shapes,
        checks,
        asked_for=asked_for,
        terms=terms,
    )


def candidate_shapes(unit: UnitDescription, temps_degc: FloatArray) -> tuple[ThermalShape, ...]:
    """Thermal shapes that unit.toml admits for temperatures (G,), fewer parameters first.

    Raises
    ------
    RefusedError
        When it asks for a function that the temperatures do not determine.
    """
    choice, t0, where = unit.thermal, unit.t0_degc, unit.source
    if choice.model == AUTO:
        return tuple(s for f in THERMAL_FUNCTIONS for s in f.candidates(temps_degc, t0))
    function = THERMAL_FUNCTIONS[choice.model]
    if len(temps_degc) < function.least_temps:
        raise RefusedError(
            f"{where}, [thermal] model",
            f'"{function.name}" with one calibrated temperature ({temps_degc[0]:.6g} degC)',
            expected=f"{function.least_temps} temperatures or more",
            remedy='measure at more temperatures, or choose "polynomial" with order = 0',
        )
    shapes = function.stated(choice.settings, temps_degc, t0)
    reason = shapes[0].undetermined(where, temps_degc) if len(shapes) == 1 else None
    if reason is not None:
        raise reason
    return shapes


def _calibration(
    unit: UnitDescription,
    measurements: MeasurementSet,
    data: TilterData,
    selection: Selection,
    range_degc: tuple[float, float],
    *,
    terms: Terms,
) -> Calibration:
    shape, readings = selection.shape, data.readings
    parameters = fit_curves(data, shape)
    shifted = shifted_voltage(readings, shape, parameters[0], unit.gravity_g)
    variance, source = _variance(measurements, readings, shifted)
    checks = check_position_dwells(measurements)
    errors = check_errors(shape, parameters, checks, unit.gravity_g, terms)[0]
    return Calibration(
        serial=unit.serial,
        estimator=selection.estimator,
        thermal=shape.model(parameters[0]),
        shape=shape,
        range_degc=range_degc,
        points=_points(data, shape, parameters[0], shifted, variance),
        parameter_covariance=parameter_covariance(data, shape, variance)[0],
        covariance_source=source,
        candidates=selection.candidates,
        selection_reason=selection.reason,
        check_dwells=tuple(
            CheckResult(dwell, float(error)) for dwell, error in zip(checks, errors, strict=True)
        ),
        terms=terms,
    )


def _points(
    data: TilterData,
    shape: ThermalShape,
    parameters: FloatArray,
    shifted: FloatArray,
    variance_v2: FloatArray,
) -> tuple[CalibrationPoint, ...]:
    operators, temps = data.operators[0], data.readings.temps_degc
    constants = constants_of(operators, shifted)
    covariance = constants_covariance(operators, variance_v2)
    force = design_matrix(data.gravity_g)[:, :3]
    on_curve = shape.basis(temps) @ parameters.T
    residuals = [
        np.sqrt(np.mean((force_from_voltage(c[:, None], shifted) - force) ** 2, axis=(1, 2)))
        for c in (constants, on_curve)
    ]
    return tuple(
        CalibrationPoint(
            temp_degc=float(temps[g]),
            constants=constants[g],
            covariance=covariance[g],
            position_residual_g=float(residuals[0][g]),
            curve_residual_g=float(residuals[1][g]),
        )
        for g in range(len(temps))
    )


def _variance(
    measurements: MeasurementSet, readings: GroupedReadings, shifted: FloatArray
) -> tuple[FloatArray, str]:
    """Variances of the readings, shape (G, 6, 3), and where they come from."""
    groups = len(readings.temps_degc)
    pooled = pooled_variance(shifted)
    if readings.variance_v2 is not None:
        allowed = np.mean(readings.variance_v2, axis=(0, 1))
        ratio = math.sqrt(float(np.mean(pooled / allowed)))
        of_all = ", sd pooled over the dwells" if readings.pooled else ""
        return readings.variance_v2, (
            f"the dwells' own statistics, sd^2 / count{of_all}; readings scatter over the "
            f"positions {ratio:.2f} times as much (1 is noise alone; more is placement, which the "
            "budget in the passport adds)"
        )
    without = [
        d.row
        for d in measurements.dwells
        if d.position.startswith("TP") and d.variance_of_mean_v2 is None
    ]
    rows = f"{len(without)} row{'s' * (len(without) != 1)}, first row {without[0]}"
    if len(without) == 6 * groups:
        rows = "all rows"
    return np.broadcast_to(pooled, readings.voltage_v.shape), (
        f"residuals over the positions, pooled over {groups} temperature{'s' * (groups != 1)} "
        f"({2 * groups} degrees of freedom an output): count and deviations are missing in {rows}"
    )


def _refuse_singular(source: str, groups: tuple[TemperatureGroup, ...], gravity_g: float) -> None:
    operator = estimator_operators("equation-10", gravity_g, None, 1)[0]
    for group in groups:
        voltage = np.array([d.voltage_v for d in group.dwells])
        where = f"{source}, rows {', '.join(str(d.row) for d in group.dwells)}"
        refuse_ill_conditioned(where, group.temp_degc, constants_of(operator, voltage))
