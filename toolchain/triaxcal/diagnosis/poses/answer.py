"""`diagnose_poses`: which cause explains the poses of a recording, and what they cannot tell."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from triaxcal.diagnosis.answer import Amplitude, Diagnosis, Suspect, answered
from triaxcal.diagnosis.poses.causes.registry import POSE_CAUSES
from triaxcal.diagnosis.poses.core.cause import KnownPoses, PoseCause, PoseHypothesis
from triaxcal.diagnosis.poses.core.evidence import JudgedPoses, Quick, SoundPoses, fit_of, judge
from triaxcal.diagnosis.poses.core.readings import PoseReadings, pose_readings
from triaxcal.diagnosis.remaining import in_words
from triaxcal.fitting.core.posterior import Posterior
from triaxcal.fitting.recorded.prepared import Prepared, weighed
from triaxcal.fitting.recorded.prior import FULL
from triaxcal.fitting.recorded.solution import ScalarFit
from triaxcal.fitting.recorded.temperatures import gain_functions, thermal_shapes
from triaxcal.fitting.recorded.wrong import wrong_poses
from triaxcal.model.types import FloatArray
from triaxcal.poses.poseset import PoseSet
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.recording import RecordingLayout

_PLACES = 2
"""Places of a cause that are judged with care."""
_FEWEST = 3
"""Causes that are judged with care, however improbable they are."""
_HOPELESS = -7.0
"""Quick log evidence against a sound unit below which a cause is not judged with care."""
_FAR = 80.0
"""Log evidence behind the best beyond which a cause is not judged with care."""
_ODD = 5


@dataclass(frozen=True)
class HeldOut:
    """What is left when a mistake is undone: |a| - g of each pose by the others, rms."""

    held_out_g: float

    @property
    def held_out(self) -> str:
        """For a table."""
        return in_words(self.held_out_g) if math.isfinite(self.held_out_g) else "-"

    @property
    def checks(self) -> str:
        """Poses have no checks."""
        return "-"

    def __str__(self) -> str:
        if not math.isfinite(self.held_out_g):
            return ""
        return f"each pose is within {self.held_out} rms of the others"


def diagnose_poses(unit: UnitDescription, layout: RecordingLayout, poses: PoseSet) -> Diagnosis:
    """Rank the causes that could explain the poses of a recording, whose directions are unknown.

    As for a tilter (`diagnosis.answer.diagnose`): causes compete by their evidence.

    Raises
    ------
    RefusedError
        For readings that are no numbers, and temperatures that do not carry what unit.toml asks.
    """
    found = weighed(unit, layout, poses)
    readings = pose_readings(poses, found)
    sound, fit = _sound(unit, found, readings)
    known = _known(unit, layout, readings, sound, fit)
    base = judge(PoseHypothesis(""), readings, sound)
    quick = Quick(readings, sound, fit)
    screened = [(cause, quick.best(cause.hypotheses(known), _PLACES)) for cause in POSE_CAUSES]
    screened = [item for item in screened if item[1]]
    screened.sort(key=lambda item: -item[1][0].log_evidence)
    least = max(fit.log_evidence + _HOPELESS, screened[0][1][0].log_evidence - _FAR)
    near = [item for item in screened if item[1][0].log_evidence > least]
    near += screened[len(near) : max(_FEWEST, len(near))]
    judged = [(cause, quick.careful(s)) for cause, best in near for s in best]
    if found.one_way:  # no pose says anything of another one's orientation
        base = replace(base, held_out_g=math.nan)
        judged = [(cause, replace(j, held_out_g=math.nan)) for cause, j in judged]
    suspects = [_suspect(cause, j, fit.log_evidence) for cause, j in judged]
    return answered(suspects, HeldOut(base.held_out_g))


def _sound(
    unit: UnitDescription, found: Prepared, readings: PoseReadings
) -> tuple[SoundPoses, Posterior]:
    """A sound unit, with the functions of temperature that make the poses most probable."""
    known = replace(found.known, zero=np.zeros(3))
    tried = []
    for shape in thermal_shapes(unit, found.temps, found.temperatures):
        basis = shape.basis(found.temps)
        for gains in [1] if shape.parameters == 1 else gain_functions(shape):
            sound = SoundPoses(known, basis, gains)
            tried.append((sound, fit_of(PoseHypothesis(""), readings, sound)))
    return max(tried, key=lambda pair: pair[1].log_evidence)


def _known(
    unit: UnitDescription,
    layout: RecordingLayout,
    readings: PoseReadings,
    sound: SoundPoses,
    fit: Posterior,
) -> KnownPoses:
    residual, slopes = sound.residual(readings, fit.theta)
    data, weight = sound.data(readings), readings.weight
    own = ScalarFit(
        FULL, sound.gain_functions, fit.theta, data, slopes * weight[:, None], residual, fit
    )
    wrong = wrong_poses(own, sound.known.noise)
    odd = _standing_out(residual, slopes, weight, fit)
    if wrong is not None:
        odd = (*wrong.indices[:1], *odd)
    some = tuple(dict.fromkeys(odd))[:_ODD]
    return KnownPoses(readings, fit.scale, some, wrong, unit.priors, layout.acceleration_unit)


def _standing_out(
    residual: FloatArray, slopes: FloatArray, weight: FloatArray, fit: Posterior
) -> tuple[int, ...]:
    """Poses by falling gain of a shift of their |a|."""
    B = weight[:, None] * (slopes @ fit.prior.factor)
    A = B.T @ B
    A.flat[:: len(A) + 1] += fit.scale**2
    leverage = (B * np.linalg.solve(A, B.T).T).sum(axis=1)
    gain = (weight * residual) ** 2 / np.maximum(1.0 - leverage, 1e-9)
    return tuple(int(k) for k in np.argsort(-gain, kind="stable")[:_ODD])


def _suspect(cause: PoseCause, judged: JudgedPoses, base: float) -> Suspect:
    hypothesis = judged.hypothesis
    amplitudes = tuple(
        Amplitude(p.name, p.unit, float(v) * p.per_unit, float(sd) * p.per_unit, abs(v) * p.moves_g)
        for p, v, sd in zip(hypothesis.parameters, judged.amplitudes, judged.sd, strict=True)
    )
    return Suspect(
        cause.name,
        cause.label,
        hypothesis.place,
        tuple(int(line) for line in hypothesis.lines),
        judged.log_evidence - base,
        hypothesis.change,
        amplitudes,
        HeldOut(judged.held_out_g),
        cause.apart,
        f"{cause.label}, {hypothesis.place}" if hypothesis.place else cause.label,
        cause.spoils,
        cause.symptom,
        (),
        judged,
    )
