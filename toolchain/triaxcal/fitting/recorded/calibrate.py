"""A recording of poses in unknown orientations -> the calibration of its unit."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.core.outliers import left_out_residuals, worst_outlier
from triaxcal.fitting.recorded.checks import (
    crowd_finding,
    refuse_few,
    refuse_left_handed,
    refuse_plane,
    refuse_unseen,
    refuse_wrong_unit,
)
from triaxcal.fitting.recorded.made import Made
from triaxcal.fitting.recorded.magnitude import fit_scalar
from triaxcal.fitting.recorded.rate import half_cycle_turns, pose_rates
from triaxcal.fitting.recorded.scalar import MODELS, NINE, ScalarData, ScalarModel, scalar_data
from triaxcal.fitting.recorded.temperatures import (
    gain_functions,
    temperature_findings,
    temperature_groups,
    thermal_shapes,
)
from triaxcal.fitting.recorded.trials import (
    TURNS_MAX,
    Judged,
    PoseClimate,
    Trial,
    choose,
    folds,
    judge,
    reason,
    unscored,
    without_idle_rates,
)
from triaxcal.model.types import FloatArray
from triaxcal.poses.poses import PoseSet, find_poses, orientation_groups
from triaxcal.readings.measurements import Dwell, MeasurementSet
from triaxcal.readings.samples import Samples
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.recording import RecordingLayout

BEYOND_1_G = "quadratic terms are measured at 1 g; above it they grow with the square, unchecked"


def calibrate_poses(
    unit: UnitDescription, layout: RecordingLayout, samples: Samples, known: FloatArray
) -> tuple[MeasurementSet, Calibration]:
    """Calibrate from poses of which only |a| = g is known; `known` is a part of Q, (3, 6).

    Raises
    ------
    RefusedError
        When the poses are too few, alike, in one plane, in another unit or left-handed, or do not
        carry what unit.toml asks for.
    """
    poses = find_poses(samples, layout)
    data, temps, findings = _prepared(unit, layout, samples, poses)
    orientations, temperatures = _groups(data, temps)
    halves = half_cycle_turns(temps)
    rates = pose_rates(samples, poses, layout) if halves else None
    if rates is None:
        halves = []  # they judge a term in dT/dt; without a clock the order has no meaning
    climate = PoseClimate(temps, rates, unit.loss)
    left_out = folds(orientations, temperatures, len(temps)) + halves
    trials = [
        replace(trial, model=replace(trial.model, known=known))
        for trial in _trials(unit, climate, temperatures)
    ]
    rows = [judge(trial, data, climate, left_out) for trial in trials]
    turns = _turns(orientations, temperatures, len(halves))
    if unscored(rows):
        # Single poses, not half-cycles, are held out here: nothing could judge a term in dT/dt.
        halves, trials = [], [trial for trial in trials if not trial.rate]
        left_out = folds([[k] for k in range(len(temps))], temperatures, len(temps))
        rows = [judge(trial, data, climate, left_out) for trial in trials]
        turns = f"{len(temps)} single poses, those of equal orientation kept,"
    if not any(row.able for row in rows):
        largest = max(rows, key=lambda row: -row.trial.parameters)
        refuse_unseen(poses, largest.fit.condition, largest.fit.unseen())
        refuse_few(poses, len(orientations), rows[0].trial.parameters + 1)
    values = sum(int(judged.sum()) for _, judged in left_out)
    able = without_idle_rates(rows, sum(int(judged.sum()) for _, judged in halves))
    best = choose(able)
    why = reason(able, best, turns, values)
    findings += _outlier(_widest_linear(rows, best), poses, unit.loss) + (
        [BEYOND_1_G] if len(best.fit.model.quadratic) else []
    )
    shown = climate.rates if best.trial.rate else None
    measurements = MeasurementSet(poses.source, pose_dwells(poses, temps, shown))
    made = Made(unit, layout, poses, climate, rows, best, why, findings)
    return measurements, made.calibration()


def _prepared(
    unit: UnitDescription, layout: RecordingLayout, samples: Samples, poses: PoseSet
) -> tuple[ScalarData, FloatArray, list[str]]:
    """Scaled poses with weights, their temperatures, and what has been found so far."""
    findings = [*poses.findings]
    refuse_wrong_unit(poses.source, poses.readings, layout)
    recorded = poses.temps_degc
    temps = np.full(len(poses.poses), unit.t0_degc) if recorded is None else recorded
    refuse_few(poses, len(poses.poses), MODELS[0].parameters)
    ones = np.ones(len(temps))
    rough = scalar_data(poses.readings, ones[:, None], ones, unit.gravity_g)
    axes = refuse_left_handed(samples, layout, rough.centre)
    orientations, _ = _groups(rough, temps)
    refuse_few(poses, len(orientations), MODELS[0].parameters)
    refuse_plane(poses, rough.radius)
    crowd = crowd_finding(orientations, poses)
    if crowd:
        findings.append(crowd)
    findings += temperature_findings(unit, recorded)
    findings.append(axes)
    weight = np.ones(len(temps))
    for group in _cells(orientations, temps):
        weight[group] = 1.0 / math.sqrt(len(group))
    data = scalar_data(poses.readings, ones[:, None], weight, unit.gravity_g)
    return data, temps, findings


def _directions(data: ScalarData) -> FloatArray:
    unit: FloatArray = data.reading / np.linalg.norm(data.reading, axis=1, keepdims=True)
    return unit


def _groups(data: ScalarData, temps: FloatArray) -> tuple[list[list[int]], list[list[int]]]:
    """Poses by orientation, and by temperature (rising)."""
    return orientation_groups(_directions(data)), temperature_groups(temps)


def _cells(orientations: list[list[int]], temps: FloatArray) -> list[list[int]]:
    """Poses alike in orientation and temperature: they say one thing, and count as one."""
    return [
        [group[k] for k in cell]
        for group in orientations
        for cell in temperature_groups(temps[group])
    ]


def _trials(
    unit: UnitDescription, climate: PoseClimate, temperatures: list[list[int]]
) -> list[Trial]:
    """Every model at one temperature, and the nine constants with each thermal order.

    With a term in dT/dt besides, where there are half-cycles to judge it on.
    """
    trials = []
    temps = climate.temps_degc
    for shape in thermal_shapes(unit, temps, temperatures):
        if shape.parameters == 1:
            trials += [Trial(model, shape, 1) for model in _models(unit)]
        else:
            gains = gain_functions(shape)
            trials += [Trial(NINE, shape, g) for g in gains]
            if climate.rates is not None:
                trials += [Trial(NINE, shape, g, rate=True) for g in gains]
    return trials


def _models(unit: UnitDescription) -> tuple[ScalarModel, ...]:
    kept = {"auto": MODELS, "linear": MODELS[:3], "quadratic": MODELS[3:]}
    return kept[unit.terms]


def _turns(orientations: list[list[int]], temperatures: list[list[int]], halves: int) -> str:
    inner = max(len(temperatures) - 2, 0) if len(temperatures) >= 4 else 0
    groups = f" in {TURNS_MAX} groups" if len(orientations) > TURNS_MAX else ""
    words = f"{len(orientations)} orientations{groups}"
    words += f" and {inner} temperatures" if inner else ""
    return words + (f" and {halves} half-cycles" if halves else "")


def _widest_linear(rows: list[Judged], best: Judged) -> Judged:
    """The chosen row or the one with most constants that is linear and follows temperature alike.

    One wrong pose can make a small model win, in which all residuals are as large as its own.
    """
    alike = [
        row
        for row in rows
        if row.able
        and not len(row.trial.model.quadratic)
        and row.trial.shape.parameters == best.trial.shape.parameters
        and row.trial.gain_functions == best.trial.gain_functions
        and row.trial.rate == best.trial.rate
    ]
    return max([best, *alike], key=lambda row: row.trial.parameters)


def _outlier(judge: Judged, poses: PoseSet, loss: str) -> list[str]:
    """Names a pose that the others contradict, by its leverage in a least-squares fit."""
    fit = judge.fit
    if loss != "linear":  # leverage and F are those of least squares
        fit = fit_scalar(fit.model, fit.data, fit.gain_functions, start=fit.theta)
    weighted = fit.residual_g * fit.data.weight
    left_out = left_out_residuals(weighted, fit.jacobian)
    found = worst_outlier(weighted[:, None], left_out[:, None], len(fit.theta))
    if found is None:
        return []
    worst = found.indices[0]
    numbers = " or ".join(f"pose {poses.poses[k].number}" for k in found.indices[:4])
    error = left_out[worst] / fit.data.weight[worst] * 1e3
    remedy = 'remove it, or set [fit] loss = "huber"' if loss == "linear" else "or remove it"
    finding = (
        f"{numbers} (line {poses.poses[worst].line}) is an outlier: |a| differs by {error:+.3g} mg "
        f"from the fit of the other poses, whose residuals are {found.others * 1e3:.2g} mg rms; "
        f"check it, {remedy}"
    )
    return [finding]


def pose_dwells(
    poses: PoseSet, temps: FloatArray, rates: FloatArray | None = None
) -> tuple[Dwell, ...]:
    """Poses as dwells, named P and their number; with dT/dt where a term in it is fitted."""
    rates = np.zeros(len(temps)) if rates is None else rates
    return tuple(
        Dwell(
            row=pose.line,
            position=f"P{pose.number}",
            temp_degc=float(temp),
            voltage_v=pose.reading,
            count=None,
            sd_v=None,
            rate_k_per_s=float(rate),
        )
        for pose, temp, rate in zip(poses.poses, temps, rates, strict=True)
    )
