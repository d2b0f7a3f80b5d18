"""A recording of poses in unknown orientations -> the calibration of its unit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.core.cubes import cube_findings
from triaxcal.fitting.core.judged import ORIENTATION, TEMPERATURE, held_out_poses
from triaxcal.fitting.recorded.contradicted import contradicted
from triaxcal.fitting.recorded.cubes import scalar_cubes
from triaxcal.fitting.recorded.made import Made
from triaxcal.fitting.recorded.magnitude import fit_with_prior
from triaxcal.fitting.recorded.prepared import Prepared, prepare
from triaxcal.fitting.recorded.prior import FULL, LINEAR, Known
from triaxcal.fitting.recorded.rate import half_cycle_turns, pose_rates
from triaxcal.fitting.recorded.scalar import MODELS, ScalarModel
from triaxcal.fitting.recorded.solution import ScalarFit
from triaxcal.fitting.recorded.temperatures import (
    gain_functions,
    thermal_shapes,
)
from triaxcal.fitting.recorded.terms import choose_terms, models_of, scaled_by_poses
from triaxcal.fitting.recorded.trials import (
    TURNS_MAX,
    Judged,
    PoseClimate,
    Trial,
    Turn,
    choose,
    expected_errors,
    judge,
    orientation_turns,
    temperature_turns,
    without_idle_rates,
    worth_judging,
)
from triaxcal.fitting.recorded.wrong import wrong_poses
from triaxcal.model.thermal.shape import ThermalShape
from triaxcal.model.types import BoolArray, FloatArray
from triaxcal.poses.poses import PoseSet, find_poses
from triaxcal.readings.measurements import Dwell, MeasurementSet
from triaxcal.readings.samples import Samples
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.recording import RecordingLayout

BEYOND_1_G = "quadratic terms are measured at 1 g; above it they grow with the square, unchecked"


@dataclass(frozen=True)
class Turns:
    """What is held out in turn, the poses alone that the others determine.

    Attributes
    ----------
    orientations, temperatures, halves : list of Turn
    words : str
    """

    orientations: list[Turn]
    temperatures: list[Turn]
    halves: list[Turn]
    words: str

    @property
    def all(self) -> list[Turn]:
        """In the order of the scores."""
        return self.orientations + self.temperatures + self.halves

    @property
    def judged(self) -> list[tuple[str, list[BoolArray]]]:
        """Masks of the poses that orientations and temperatures judge."""
        kinds = ((ORIENTATION, self.orientations), (TEMPERATURE, self.temperatures))
        return [(what, [judged for _, judged in turns]) for what, turns in kinds]

    @staticmethod
    def values(turns: list[Turn]) -> int:
        """How many values turns judge."""
        return sum(int(judged.sum()) for _, judged in turns)


def calibrate_poses(
    unit: UnitDescription, layout: RecordingLayout, samples: Samples, quadratic: FloatArray
) -> tuple[MeasurementSet, Calibration]:
    """Calibrate from poses of which only |a| = g is known; `quadratic` is known of Q, (3, 6).

    Raises
    ------
    RefusedError
        When there is no pose, readings are in another unit or left-handed, or the poses do not
        carry what unit.toml asks for.
    """
    poses = find_poses(samples, layout)
    found, climate, turns, thermal, best = _linear(unit, layout, samples, poses, quadratic)
    base = thermal[0].trial
    models = [_with(quadratic, model) for model in models_of(unit)]
    trials = [replace(best.trial, model=model) for model in models]
    full = judge(trials[-1], found.data, climate, turns.all)
    scaled = [scaled_by_poses(trial, found.data, climate, turns.all, full.fit) for trial in trials]
    delivered = choose_terms(unit, full, scaled)
    rows = [*(s.row for s in scaled), best] + [full] * (len(models) > 1)
    plain = _plain_rows(unit, found, climate, replace(base, known=None), turns)
    why = _reason(thermal, delivered.own, turns, delivered.reason)
    outlier = _outliers(unit, found, delivered.full, poses)
    findings = found.findings + outlier
    findings += [BEYOND_1_G] if len(delivered.own.fit.model.quadratic) else []
    findings += cube_findings([scalar_cubes(delivered.full.fit, found.known.noise)])
    shown = climate.rates if best.trial.rate else None
    measurements = MeasurementSet(poses.source, pose_dwells(poses, found.temps, shown))
    others = [row for row in thermal if row is not best]
    made = Made(
        unit,
        layout,
        poses,
        climate,
        [*rows, *others, *plain],
        delivered,
        best,
        Turns.values(turns.orientations),
        held_out_poses(delivered.own.errors_g, turns.judged),
        why,
        findings,
        # An outlier would contradict priors as well.
        [] if outlier else contradicted(delivered.full, unit.t0_degc),
    )
    return measurements, made.calibration()


def _linear(
    unit: UnitDescription,
    layout: RecordingLayout,
    samples: Samples,
    poses: PoseSet,
    quadratic: FloatArray,
) -> tuple[Prepared, PoseClimate, Turns, list[Judged], Judged]:
    """The poses made ready, what is held out, and the linear constants by each thermal function.

    The last is the row whose thermal function is taken.
    """
    found = prepare(unit, layout, samples, poses)
    halves = half_cycle_turns(found.temps)
    rates = pose_rates(samples, poses, layout) if halves else None
    climate = PoseClimate(found.temps, rates, unit.loss)
    shapes = thermal_shapes(unit, found.temps, found.temperatures)
    base = Trial(_with(quadratic, LINEAR), shapes[0], 1, known=found.known)
    turns = _turns(unit, found, climate, base, halves if rates is not None else [])
    thermal = _thermal_rows(found, climate, shapes, base, turns)
    best = choose(without_idle_rates(thermal, Turns.values(turns.halves)))
    return found, climate, turns, thermal, best


def fit_of_all_terms(
    unit: UnitDescription, layout: RecordingLayout, samples: Samples
) -> tuple[Known, ScalarFit]:
    """What is known beforehand, and the fit with all terms, of a recording of poses.

    Raises
    ------
    RefusedError
        As `calibrate_poses`.
    """
    poses = find_poses(samples, layout)
    found, climate, _, _, best = _linear(unit, layout, samples, poses, np.zeros((3, 6)))
    row = judge(replace(best.trial, model=FULL), found.data, climate, [])
    return found.known, row.fit


def _with(quadratic: FloatArray, model: ScalarModel) -> ScalarModel:
    """A model with a part of Q that is known beforehand."""
    return replace(model, known=quadratic)


def _turns(
    unit: UnitDescription, found: Prepared, climate: PoseClimate, base: Trial, halves: list[Turn]
) -> Turns:
    """What is held out: orientations, or single poses where those determine nothing of each other.

    Single poses judge no half-cycle: nothing could judge a term in dT/dt.
    """
    count = len(found.temps)
    limit_g = np.array([unit.limits.at(t, unit.t0_degc)[0] for t in found.temps])

    def judged(turns: list[Turn]) -> list[Turn]:
        return worth_judging(turns, expected_errors(base, found.data, climate, turns), limit_g)

    inner = judged(temperature_turns(found.temperatures, count))
    if found.one_way:  # nothing of another orientation is tested
        return Turns([], [], [], "no orientation")
    kept = judged(orientation_turns(found.orientations, count))
    if kept:
        groups = f" in {TURNS_MAX} groups" if len(found.orientations) > TURNS_MAX else ""
        words = f"{len(found.orientations)} orientations{groups}"
        if len(kept) < min(len(found.orientations), TURNS_MAX):
            words = f"{len(kept)} of {words}, those that the others determine"
        halves = judged(halves)
        words += f" and {len(inner)} temperatures" if inner else ""
        words += f" and {len(halves)} half-cycles" if halves else ""
        return Turns(kept, inner, halves, words)
    single = judged(orientation_turns([[k] for k in range(count)], count)) if count > 1 else []
    words = f"{Turns.values(single)} single poses, those of equal orientation kept,"
    return Turns(single, inner if single else [], [], words)


def _thermal_rows(
    found: Prepared,
    climate: PoseClimate,
    shapes: Sequence[ThermalShape],
    base: Trial,
    turns: Turns,
) -> list[Judged]:
    """The linear constants with priors by each thermal function, with and without dT/dt."""
    trials = []
    for shape in shapes:
        gains = [1] if shape.parameters == 1 else gain_functions(shape)
        trials += [replace(base, shape=shape, gain_functions=g) for g in gains]
        if shape.parameters > 1 and climate.rates is not None and turns.halves:
            trials += [replace(base, shape=shape, gain_functions=g, rate=True) for g in gains]
    return [judge(trial, found.data, climate, turns.all) for trial in trials]


def _plain_rows(
    unit: UnitDescription,
    found: Prepared,
    climate: PoseClimate,
    base: Trial,
    turns: Turns,
) -> list[Judged]:
    """Candidates without priors at one temperature: a diagnosis."""
    if base.shape.parameters > 1:
        return []
    models = {"auto": MODELS, "linear": MODELS[:3], "quadratic": MODELS[3:]}[unit.terms]
    trials = [replace(base, model=_with(base.model.known, model)) for model in models]
    trials = [trial for trial in trials if trial.parameters <= len(found.temps)]
    return [judge(trial, found.data, climate, turns.all) for trial in trials]


def _reason(thermal: Sequence[Judged], best: Judged, turns: Turns, terms: str) -> str:
    """Why this calibration, in words."""
    count = Turns.values(turns.all)
    label = best.trial.label
    if best.held_out_g is None:
        text = f"{label}: no pose is determined by the others, so none is held out"
    else:
        text = (
            f"{label}: held-out error {best.held_out_g * 1e3:.3g} mg over "
            f"{count} value{'s' * (count != 1)} ({turns.words} held out in turn)"
        )
    if len(thermal) > 1:
        how = "no other is significantly better" if best.held_out_g else "the most probable"
        text += f"; of {len(thermal)} thermal functions, {how}"
    return f"{text}. Terms beyond the linear constants: {terms}"


def _outliers(unit: UnitDescription, found: Prepared, row: Judged, poses: PoseSet) -> list[str]:
    """Names the poses that the others contradict in the fit with all terms."""
    fit = row.fit
    if unit.loss != "linear":  # the odds are those of least squares
        fit = fit_with_prior(fit.model, fit.data, fit.gain_functions, found.known)
    wrong = wrong_poses(fit, found.known.noise)
    if wrong is None or not wrong.told:
        return []
    named = [poses.poses[k] for k in wrong.indices]
    pronoun = "it" if len(named) == 1 else "them"
    lines = _listed([f"pose {pose.number} (line {pose.line})" for pose in named])
    verb = "is an outlier" if len(named) == 1 else "are outliers"
    errors = _listed([f"{error * 1e3:+.3g}" for error in wrong.error_g])
    rivals = ""
    if wrong.rivals:
        also = [str(poses.poses[k].number) for k in wrong.rivals]
        rivals = f"; as probable: pose{'s' * (len(also) != 1)} {', '.join(also)}"
    remedy = f"or remove {pronoun}"
    if unit.loss == "linear":
        remedy = f'remove {pronoun}, or set [fit] loss = "huber"'
    finding = (
        f"{lines} {verb}: |a| differs by {errors} mg from the fit of the other poses, whose noise "
        f"is {wrong.others_g * 1e3:.2g} mg{rivals}; check {pronoun}, {remedy}"
    )
    return [finding]


def _listed(words: Sequence[str]) -> str:
    return " and ".join(filter(None, [", ".join(words[:-1]), words[-1]]))


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
