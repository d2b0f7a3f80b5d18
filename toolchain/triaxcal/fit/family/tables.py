"""Poses with the angles of a table -> the calibration of the unit, P0."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from triaxcal.errors import RefusedError
from triaxcal.fit.calibrate import Calibration, CalibrationPoint
from triaxcal.fit.family.checks import CONDITION_MAX, refuse_wrong_unit
from triaxcal.fit.family.frame import rotation_to, turned_constants
from triaxcal.fit.family.harmonics import table_findings
from triaxcal.fit.family.oriented import (
    OrientedFit,
    SerialGrid,
    inverse_linear,
    inverse_quadratic,
    table_error_g,
)
from triaxcal.fit.family.recordings import BEYOND_1_G, pose_dwells, recording_range
from triaxcal.fit.family.result import RecordingFit
from triaxcal.fit.family.scalar import NINE, fit_scalar, scalar_data
from triaxcal.fit.family.table_checks import (
    known_force,
    one_temperature,
    refuse_degrees,
    refuse_few_poses,
    refuse_open,
)
from triaxcal.fit.family.trials import beats
from triaxcal.fit.selection import Candidate
from triaxcal.fit.thermal import polynomial_shape
from triaxcal.model.metrological import pack_constants
from triaxcal.model.orientation import angles_from_force, gravity_direction
from triaxcal.model.terms import NO_TERMS, Terms
from triaxcal.model.types import FloatArray
from triaxcal.recording.poses import PoseSet, find_poses
from triaxcal.recording.samples import Samples
from triaxcal.recordinglayout import Angles, RecordingLayout
from triaxcal.records import MeasurementSet
from triaxcal.unitfile import UnitDescription

_RAD_PER_ARCSEC = math.pi / 180.0 / 3600.0
_Solver = Callable[[FloatArray, FloatArray], OrientedFit]


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


_CANDIDATES: tuple[tuple[str, str, int, _Solver], ...] = (
    ("linear (12)", "inverse form", 12, inverse_linear),
    ("linear (28)", "forward form", 12, _forward),
    ("nine constants and the turn to the table", "|a| = g", 12, _scalar),
    ("quadratic (13)", "inverse form", 27, inverse_quadratic),
    ("quadratic (29)", "forward form", 27, _forward_quadratic),
)
"""Label, way, unknowns, solver; simpler ones first."""


@dataclass(frozen=True)
class _Row:
    label: str
    way: str
    parameters: int
    fit: OrientedFit
    fitted_g: float
    held_out_g: float | None
    errors_g: FloatArray | None = None


def calibrate_table(
    unit: UnitDescription, layout: RecordingLayout, angles: Angles, samples: Samples
) -> tuple[MeasurementSet, Calibration]:
    """Calibrate from poses whose angles are known.

    Raises
    ------
    RefusedError
        When the poses are too few or leave a constant open, angles are in the other unit, axes are
        exchanged or left-handed, or the poses are at more than one temperature.
    """
    poses = find_poses(samples, layout)
    readings, table = poses.readings, np.array([p.angles_rad for p in poses.poses])
    refuse_wrong_unit(poses.source, readings, layout)
    refuse_few_poses(poses)
    refuse_degrees(poses.source, angles, readings, table, unit.gravity_g)
    refuse_open(poses, gravity_direction(angles.kind, table))
    temps = one_temperature(unit, poses)
    force, sign = known_force(poses.source, angles, readings, table, unit.gravity_g)
    rows = [
        _judge(*candidate, readings=readings, force=force)
        for candidate in _CANDIDATES
        if unit.terms == "auto" or (unit.terms == "quadratic") == candidate[0].startswith("quadr")
    ]
    able = [r for r in rows if r.held_out_g is not None]
    if not able:
        raise RefusedError(
            poses.source,
            f"the {len(poses.poses)} poses leave constants open (condition number "
            f"{min(r.fit.condition for r in rows):.3g})",
            expected=f"{CONDITION_MAX:g} at most, with each pose left out in turn",
            remedy="add poses over both angles",
        )
    best, why = _choose(able)
    findings = [
        *poses.findings,
        *([] if best.fit.quadratic is None else [BEYOND_1_G]),
        *table_findings(angles, table, readings, sign * best.fit.force_g(readings), unit.gravity_g),
        _angle_residuals(angles, table, sign * best.fit.force_g(readings)),
        *_budget(unit, angles, table, best),
    ]
    dwells = MeasurementSet(poses.source, pose_dwells(poses, temps))
    return dwells, _calibration(
        unit, layout, poses, temps, rows=rows, best=best, why=why, findings=findings, force=force
    )


def _judge(
    label: str,
    way: str,
    parameters: int,
    solver: _Solver,
    *,
    readings: FloatArray,
    force: FloatArray,
) -> _Row:
    """Fit, and the error of each component at each pose left out in turn."""
    fit = solver(readings, force)
    fitted = float(np.sqrt(np.mean((fit.force_g(readings) - force) ** 2)))
    if fit.condition > CONDITION_MAX or len(readings) <= parameters // 3 + 1:
        return _Row(label, way, parameters, fit, fitted, None)
    errors = []
    for k in range(len(readings)):
        kept = np.arange(len(readings)) != k
        part = solver(readings[kept], force[kept])
        if part.condition > 10.0 * CONDITION_MAX:
            return _Row(label, way, parameters, fit, fitted, None)
        errors.append(part.force_g(readings[~kept]) - force[~kept])
    every = np.concatenate(errors)
    score = float(np.sqrt(np.mean(every**2)))
    return _Row(label, way, parameters, fit, fitted, score, every)


def _choose(rows: Sequence[_Row]) -> tuple[_Row, str]:
    unbeaten = [r for r in rows if not any(beats(o.errors_g, r.errors_g) for o in rows)]
    best = min(unbeaten, key=lambda r: r.parameters)
    return best, (
        f"{best.label}, {best.way}: held-out error {(best.held_out_g or 0.0) * 1e3:.3g} mg a "
        f"component, each pose left out in turn; of {len(rows)} candidates the simplest that none "
        "is told to beat"
    )


def _angle_residuals(angles: Angles, table: FloatArray, force: FloatArray) -> str:
    """P0 (8): the angles back from the compensated readings against those that were set."""
    difference = angles_from_force(angles.kind, force) - table[:, :2]
    wrapped = np.degrees((difference + np.pi) % (2.0 * np.pi) - np.pi) * 3600.0
    rms = np.sqrt(np.mean(wrapped**2, axis=0))
    names = ("pitch", "roll") if angles.kind == "aircraft" else ("zenith", "tool face")
    return "angles back from the readings (8): " + ", ".join(
        f"{name} {value:.3g} arcsec rms" for name, value in zip(names, rms, strict=True)
    )


def _budget(unit: UnitDescription, angles: Angles, table: FloatArray, best: _Row) -> list[str]:
    """The table's own errors in g beside sqrt(eps), where unit.toml states them; P0, section 5."""
    stated = unit.stated
    if stated.repeatability_arcsec is None and stated.level_arcsec is None:
        return []
    angle, level = stated.repeatability_arcsec or 0.0, stated.level_arcsec or 0.0
    errors = table_error_g(
        angles.kind, table, angle * _RAD_PER_ARCSEC, level * _RAD_PER_ARCSEC, unit.gravity_g
    )
    budget = float(np.sqrt(np.mean(errors**2))) * 1e6
    found = best.fitted_g * 1e6
    words = "as the table allows" if found <= 2.0 * budget else "more than the table explains"
    told = (
        f"table: {angle:g} arcsec an angle, {level:g} arcsec of level are {budget:.3g} micro-g rms"
    )
    return [f"{told}; sqrt(eps) is {found:.3g} micro-g, {words}"]


def _calibration(
    unit: UnitDescription,
    layout: RecordingLayout,
    poses: PoseSet,
    temps: FloatArray,
    *,
    rows: Sequence[_Row],
    best: _Row,
    why: str,
    findings: Sequence[str],
    force: FloatArray,
) -> Calibration:
    shape = polynomial_shape(temps, unit.t0_degc, 0)
    constants = pack_constants(best.fit.K, best.fit.U0)
    covariance = _covariance(poses.readings, best.fit, force)
    errors = np.linalg.norm(best.fit.force_g(poses.readings), axis=1) - unit.gravity_g
    dof = max(3 * len(temps) - best.parameters, 1)
    squares = np.sum((best.fit.force_g(poses.readings) - force) ** 2)
    recording = RecordingFit(
        poses=poses,
        route="angles of a table known",
        covariance=covariance[:, None, :, None],
        dof=dof,
        rms_g=best.fitted_g,
        rms_free_g=math.sqrt(float(squares) / dof),
        held_out_g=best.held_out_g,
        condition=best.fit.condition,
        weakest="",
        residual_g=errors,
        findings=tuple(findings),
    )
    blocks = np.array([[3 * i, 3 * i + 1, 3 * i + 2, 9 + i] for i in range(3)])
    by_output = np.stack([covariance[np.ix_(b, b)] for b in blocks])[:, :, None, :, None]
    point = CalibrationPoint(unit.t0_degc, constants, covariance, best.fitted_g, best.fitted_g)
    return Calibration(
        serial=unit.serial,
        estimator=best.way,
        thermal=shape.model(constants[:, None]),
        shape=shape,
        range_degc=recording_range(unit, poses, temps),
        points=(point,),
        parameter_covariance=by_output,
        covariance_source=f"residuals over the poses, {dof} degrees of freedom",
        candidates=tuple(_candidate(row, shape.kind, chosen=row is best) for row in rows),
        selection_reason=why,
        check_dwells=(),
        terms=NO_TERMS if best.fit.quadratic is None else Terms(best.fit.quadratic),
        recording=recording,
        reading_unit=layout.acceleration_unit,
    )


def _candidate(row: _Row, kind: str, *, chosen: bool) -> Candidate:
    return Candidate(
        estimator=row.way,
        thermal=kind,
        order=0,
        knots_degc=(),
        parameters=row.parameters,
        held_out_g=row.held_out_g,
        fit_residual_g=row.fitted_g,
        chosen=chosen,
        label=row.label,
        condition=row.fit.condition,
    )


def _covariance(readings: FloatArray, fit: OrientedFit, force: FloatArray) -> FloatArray:
    """Covariance of the twelve constants, (12, 12): least squares of (28), outputs independent."""
    design = np.concatenate([force, np.ones((len(force), 1))], axis=1)
    inverse = np.linalg.inv(design.T @ design)
    linear = np.linalg.solve(fit.K, (readings - fit.U0).T).T
    modelled = force if fit.quadratic is None else force - (fit.force_g(readings) - linear)
    residual = readings - fit.U0 - modelled @ fit.K.T
    variance = (residual**2).sum(axis=0) / max(len(force) - 4, 1)
    full = np.zeros((12, 12))
    for i in range(3):
        index = np.array([3 * i, 3 * i + 1, 3 * i + 2, 9 + i])
        full[np.ix_(index, index)] = variance[i] * inverse
    return full
