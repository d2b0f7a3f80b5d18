"""Poses with the angles of a table -> the calibration of the unit, P0."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.core.cubes import cube_findings
from triaxcal.fitting.core.judged import (
    ORIENTATION,
    TEMPERATURE,
    HeldOutPoses,
    held_out_poses,
)
from triaxcal.fitting.core.recorded import NO_TERMS_COVARIANCE, RecordingFit, TermsCovariance
from triaxcal.fitting.recorded.calibrate import BEYOND_1_G, pose_dwells
from triaxcal.fitting.recorded.checks import CONDITION_MAX
from triaxcal.fitting.recorded.made import recorded_calibration
from triaxcal.fitting.recorded.temperatures import (
    temperature_findings,
    temperature_groups,
)
from triaxcal.fitting.table.candidates import (
    LEFT_OUT_MAX,
    TablePoses,
    TableRow,
    judge_table,
    thermal_design,
    turns,
)
from triaxcal.fitting.table.checks import (
    known_force,
    pose_temperatures,
    refuse_degrees,
    refuse_few_poses,
    refuse_open,
    refuse_silent,
)
from triaxcal.fitting.table.choice import choose_table
from triaxcal.fitting.table.cubes import table_cubes
from triaxcal.fitting.table.harmonics import table_findings
from triaxcal.fitting.table.oriented import TRACELESS, table_error_g
from triaxcal.fitting.table.trials import trials_of
from triaxcal.fitting.table.wrongrows import wrong_row_findings, wrong_rows
from triaxcal.fitting.tilter.mounting import turned_notes, unequal_notes
from triaxcal.model.orientation import angle_slopes, angles_from_force, gravity_direction
from triaxcal.model.positions import AXES
from triaxcal.model.terms import NO_TERMS, PRODUCT_NAMES, Terms, products
from triaxcal.model.types import FloatArray
from triaxcal.poses.poses import PoseSet, find_poses
from triaxcal.readings.measurements import MeasurementSet
from triaxcal.readings.samples import Samples
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.recording import Angles, RecordingLayout

_RAD_PER_ARCSEC = math.pi / 180.0 / 3600.0


def calibrate_table(
    unit: UnitDescription,
    layout: RecordingLayout,
    angles: Angles,
    samples: Samples,
    known_quadratic: FloatArray,
) -> tuple[MeasurementSet, Calibration]:
    """Calibrate from poses whose angles are known; `known_quadratic` is a part of Q, (3, 6).

    Raises
    ------
    RefusedError
        When there are too few poses, the angles are in another unit, the axes are exchanged or
        left-handed, the angles leave constants open, or a pose contradicts the others by more
        than the limit.
    """
    poses = find_poses(samples, layout)
    readings, table = poses.readings, np.array([p.angles_rad for p in poses.poses])
    refuse_few_poses(poses)
    refuse_degrees(poses.source, angles, readings, table, unit.gravity_g)
    refuse_open(poses, gravity_direction(angles.kind, table))
    refuse_silent(poses, gravity_direction(angles.kind, table))
    temps, temperatures = pose_temperatures(unit, poses)
    force, sign = known_force(unit, poses, layout, table)
    known = TablePoses(readings, force, temps, known_quadratic)
    left_out = turns(known, temperatures)
    tried = trials_of(unit, temps, temperatures)
    rows = [judge_table(trial, known, left_out) for trial in tried]
    able = [r for r in rows if r.held_out_g is not None]
    # Where no linear candidate can be scored, quadratic terms only hide what is open.
    if not able or (
        any(not r.trial.quadratic for r in rows) and all(r.trial.quadratic for r in able)
    ):
        raise _open(unit, poses, rows)
    best, why = choose_table(able, temperatures)
    wrong = wrong_rows(best.trial, known, best)
    found = sign * (best.own_g + force)
    constants = best.fit.shape.model(best.fit.constants).constants_at(unit.t0_degc)
    near = min(temperatures, key=lambda group: abs(temps[group].mean() - unit.t0_degc))
    findings = [
        *poses.findings,
        *wrong_row_findings(unit, angles, poses, table=table, sign=sign, rows=wrong),
        *([BEYOND_1_G] if best.trial.parameters > 12 and best.fit.quadratic is not None else []),
        *cube_findings(table_cubes(best, known)),
        *_shares(best),
        *temperature_findings(unit, poses.temps_degc),
        *table_findings(angles, table[near], readings[near], found[near], unit.gravity_g),
        *turned_notes(constants),
        *unequal_notes(constants),
        _angle_residuals(angles, table, found),
        *_budget(unit, angles, table, best),
    ]
    dwells = MeasurementSet(poses.source, pose_dwells(poses, temps))
    return dwells, _calibration(
        unit, layout, poses, known, rows=rows, best=best, why=why, findings=findings
    )


def _open(unit: UnitDescription, poses: PoseSet, rows: Sequence[TableRow]) -> RefusedError:
    """Why no candidate is scored: the condition number of all poses, or with some held out."""
    detail, expected = "", "more values than constants, with each pose held out in turn"
    numbers = [(row.open_at, row.fit.condition) for row in rows if row.open_at is not None]
    if numbers:
        found, of_all = min(numbers)
        in_turn = of_all <= CONDITION_MAX
        detail = f"{' when some are held out' * in_turn} (condition number {found:.3g})"
        expected = f"at most {CONDITION_MAX:g}"
        if in_turn:
            expected = f"at most {LEFT_OUT_MAX:g}, with each pose held out in turn"
    return RefusedError(
        poses.source,
        f"the {len(poses.poses)} poses do not determine all constants{detail}",
        expected=expected,
        remedy='add poses over both angles, or remove terms = "quadratic"'
        if unit.terms == "quadratic"
        else "add poses over both angles",
    )


def _shares(best: TableRow) -> list[str]:
    """The quadratic terms, and how much of each the readings determine and how much its prior."""
    full = best.fit.full
    if full is None:
        return []
    sd = np.sqrt(np.diag(full.quadratic_covariance)).reshape(3, 6)
    rows = [
        f"{AXES[i]}: "
        + ", ".join(
            f"{name} {full.quadratic[i, k] * 1e6:.3g} +- {sd[i, k] * 1e6:.2g} "
            f"({max(full.by_data[i, k], 0.0) * 100.0:.0f} %)"
            for k, name in enumerate(PRODUCT_NAMES)
        )
        for i in range(3)
    ]
    head = "quadratic terms, 1e-6 g/g^2 +- sd (share of the readings in it, the rest is [priors])"
    return [f"{head}; {'; '.join(rows)}"]


def _angle_residuals(angles: Angles, table: FloatArray, force: FloatArray) -> str:
    """P0 (8): the angles back from the compensated readings against those that were set.

    The second turns the force by less where the first is steep, by nothing at pitch 90 deg, where
    it cannot be seen: it is weighted with what it turns.
    """
    difference = angles_from_force(angles.kind, force) - table[:, :2]
    wrapped = np.degrees((difference + np.pi) % (2.0 * np.pi) - np.pi) * 3600.0
    wrapped[:, 1] *= np.linalg.norm(angle_slopes(angles.kind, table[:, :2])[..., 1], axis=-1)
    rms = np.sqrt(np.mean(wrapped**2, axis=0))
    names = ("pitch", "roll") if angles.kind == "aircraft" else ("zenith", "tool face")
    return "angles back from the readings: " + ", ".join(
        f"{name} {value:.3g} arcsec rms" for name, value in zip(names, rms, strict=True)
    )


def _budget(unit: UnitDescription, angles: Angles, table: FloatArray, best: TableRow) -> list[str]:
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
    words = "consistent" if found <= 2.0 * budget else "more than the table explains"
    table_words = (
        f"table: {angle:g} arcsec an angle, {level:g} arcsec of level are {budget:.3g} micro-g rms"
    )
    return [f"{table_words}; the fit's residual is {found:.3g} micro-g, {words}"]


def _calibration(
    unit: UnitDescription,
    layout: RecordingLayout,
    poses: PoseSet,
    known: TablePoses,
    *,
    rows: Sequence[TableRow],
    best: TableRow,
    why: str,
    findings: Sequence[str],
) -> Calibration:
    shape, temps = best.fit.shape, known.temps_degc
    full = best.fit.full
    errors = np.linalg.norm(best.own_g + known.force, axis=1) - unit.gravity_g
    if full is None:
        covariance, terms = _covariance(best, known)
        dof = 3 * len(temps) - best.trial.parameters
    else:
        covariance = full.covariance
        terms = TermsCovariance(full.quadratic_covariance, full.cross)
        dof = max(1, 3 * len(temps) - round(float(full.effective.sum())))
    held_out = _held_out(best, known, unit.gravity_g)
    recording = RecordingFit(
        poses=poses,
        route="angles of a table known",
        covariance=covariance,
        dof=float(dof),
        rms_g=best.fitted_g,
        rms_free_g=math.sqrt(float((best.own_g**2).sum()) / dof),
        held_out_g=best.held_out_g,
        left_out_length_g=float(np.sqrt(np.mean(held_out[0].error_g ** 2))) if held_out else None,
        condition=best.fit.condition,
        weakest="",
        residual_g=errors,
        findings=tuple(findings),
        terms=terms,
        held_out=held_out,
    )
    return recorded_calibration(
        unit,
        layout,
        (shape, best.fit.constants),
        recording,
        temps,
        estimator=best.trial.way,
        covariance_source=f"residuals over the poses, {dof} degrees of freedom",
        candidates=tuple(row.candidate(chosen=row is best) for row in rows),
        selection_reason=why,
        terms=NO_TERMS if best.fit.quadratic is None else Terms(best.fit.quadratic),
    )


def _held_out(best: TableRow, known: TablePoses, gravity_g: float) -> tuple[HeldOutPoses, ...]:
    """|a| - g and components of each pose held out in turn, and of each inner temperature."""
    if best.errors_g is None:
        return ()
    masks, count = turns(known, temperature_groups(known.temps_degc)), len(known.force)
    force = np.concatenate([known.force[mask] for mask in masks]) + best.errors_g
    lengths = np.linalg.norm(force, axis=1) - gravity_g
    kinds = ((ORIENTATION, masks[:count]), (TEMPERATURE, masks[count:]))
    return held_out_poses(lengths, kinds, np.sqrt(np.mean(best.errors_g**2, axis=1)))


def _covariance(best: TableRow, known: TablePoses) -> tuple[FloatArray, TermsCovariance]:
    """Covariance (12, P, 12, P) of the constants, and that of Q where it is fitted.

    Least squares of (28), with the products of (29) beside it; outputs independent.
    """
    shape, gains = best.fit.shape, best.trial.gains
    linear = thermal_design(shape, gains, known)
    fitted = best.trial.parameters > 3 * linear.shape[1]
    design = linear
    if fitted:
        design = np.concatenate([linear, products(known.target) @ TRACELESS.T], axis=1)
    inverse = np.linalg.inv(design.T @ design)
    constants = shape.basis(known.temps_degc) @ best.fit.constants.T
    K = constants[:, :9].reshape(-1, 3, 3)
    # The error of the force, as the outputs have it.
    residual = np.einsum("nij,nj->ni", K, best.own_g)
    variance = (residual**2).sum(axis=0) / max(len(design) - design.shape[1], 1)
    count = shape.parameters
    full = np.zeros((12, count, 12, count))
    for i in range(3):
        index = [(3 * i + j, p) for j in range(3) for p in range(gains)]
        index += [(9 + i, p) for p in range(count)]
        of_constant, of_function = (np.array(part) for part in zip(*index, strict=True))
        rows = of_constant[:, None], of_function[:, None]
        own = inverse[: len(index), : len(index)]
        full[*rows, of_constant[None], of_function[None]] = variance[i] * own
    if not fitted:
        return full, NO_TERMS_COVARIANCE
    # (29) has its products in the outputs: Q = -K^-1 D2, at one temperature.
    to_force = -np.linalg.inv(K[0])
    at = linear.shape[1]
    D2 = TRACELESS.T @ inverse[at:, at:] @ TRACELESS
    own_q = np.einsum("io,jo,o,kl->ikjl", to_force, to_force, variance, D2).reshape(18, 18)
    cross = np.zeros((12, count, 3, 6))
    for o in range(3):
        mixed = variance[o] * inverse[:at, at:] @ TRACELESS
        rows_of_output = [3 * o, 3 * o + 1, 3 * o + 2, 9 + o]
        cross[rows_of_output, 0] = mixed[:, None, :] * to_force[:, o][None, :, None]
    return full, TermsCovariance(own_q, cross.reshape(12, count, 18))
