"""The evidence of a hypothesis, with the scales and amplitudes that explain the readings best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from triaxcal.diagnosis.core.cause import Hypothesis, Size
from triaxcal.diagnosis.core.curves import constants
from triaxcal.diagnosis.core.readings import Readings
from triaxcal.diagnosis.core.scales import SCALE_NAMES, Scales, nearby
from triaxcal.diagnosis.core.sound import Added, Fit, System
from triaxcal.model.types import FloatArray

FAULT_LOG_ODDS = -5.0
"""Before the data, of each cause against a sound unit: one unit in 150 has it.

All causes together make it one unit in six, as of units whose readings somebody looks into.
"""
_ROUNDS = 8
_TURNS = 6
_CONDITION_MAX = 4.0
"""Of K with unit rows, beyond which the constants say nothing about the check dwells."""
_STILL_G = 3e-6
_ABSURD = 10.0


@dataclass(frozen=True)
class Judged:
    """A hypothesis and how well it explains the readings.

    Attributes
    ----------
    log_evidence : float
        With what makes its place and cause improbable beforehand.
    log_likelihood : float
        Of the readings alone, whatever the number of places.
    amplitudes : array, shape (k,)
    system, fit, scales, added
        Of the readings without the mistake.
    """

    hypothesis: Hypothesis
    log_evidence: float
    log_likelihood: float
    amplitudes: FloatArray
    system: System
    fit: Fit
    scales: Scales
    added: Added | None

    @property
    def sd(self) -> FloatArray:
        """Standard deviations of the amplitudes, shape (k,)."""
        return self.fit.amplitude_sd


def log_prior(hypothesis: Hypothesis) -> float:
    """Of one place of one cause, against a sound unit."""
    sizes = len(hypothesis.sizes) if hypothesis.parameters else 1
    ways = hypothesis.places * sizes * max(len(hypothesis.noise), 1)
    return FAULT_LOG_ODDS + hypothesis.log_prior + hypothesis.log_density - float(np.log(ways))


def linked(
    readings: Readings,
    scales: Scales,
    theta: FloatArray | None = None,
    hypothesis: Hypothesis | None = None,
) -> System:
    """Model of readings whose check dwells are linear about the constants that fit them."""
    unused = None if hypothesis is None else hypothesis.unused
    if readings.test.all() or (hypothesis is not None and hypothesis.blind):
        return System(readings, None, unused)
    turns = 1
    if theta is None:
        theta = System(readings, None, unused).fit(scales).theta
        turns = 2
    for _ in range(turns):
        if not sensible(theta, readings):
            return System(readings, None, unused)
        system = System(readings, theta, unused)
        theta = system.fit(scales).theta
    return system


def sensible(theta: FloatArray, readings: Readings) -> bool:
    """Whether K is near the identity wherever there are check dwells."""
    K = constants(theta, readings.temps_degc, readings.t0_degc)[:, :, 1:]
    lengths = np.linalg.norm(K, axis=2)
    if not np.isfinite(K).all() or (lengths < 0.3).any() or (lengths > 3.0).any():
        return False
    unit = K / lengths[:, :, None]
    gram = np.abs(unit @ np.swapaxes(unit, 1, 2))
    # Gershgorin: the squared singular values are within 1 -+ `most`. Mostly that is enough.
    most = gram.sum(axis=2).max() - 1.0
    if (1.0 + most) < _CONDITION_MAX**2 * (1.0 - most) * (1.0 - 1e-9):
        return True
    return bool((np.linalg.cond(unit) < _CONDITION_MAX).all())


def climb(
    system: System,
    scales: Scales,
    added: Added | None = None,
    *,
    fixed: Sequence[str] = (),
    rounds: int = _ROUNDS,
) -> tuple[Fit, Scales]:
    """Scales that make the readings most probable, found by one scale after the other."""
    best = system.fit(scales, added)
    for _ in range(rounds):
        before = scales
        for name in SCALE_NAMES:
            if name in fixed:
                continue
            for trial in nearby(scales, name):
                fit = system.fit(trial, added)
                if fit.log_evidence > best.log_evidence:
                    best, scales = fit, trial
                    break
        if scales == before:
            break
    return best, scales


def judge(hypothesis: Hypothesis, readings: Readings, start: Scales, theta: FloatArray) -> Judged:
    """Evidence of a hypothesis with the best scales; `theta` are constants to start from.

    Its effect need not be small: it is taken off at the amplitudes found, and the rest is linear.
    """
    if hypothesis.noise:
        start = replace(start, noise=hypothesis.noise[0])
    if hypothesis.parameters:
        system, scales, added = _with_amplitudes(hypothesis, readings, start, theta)
    else:
        mended = hypothesis.undo(readings, np.zeros(0))
        system, scales, added = linked(mended, start, hypothesis=hypothesis), start, None
    fixed: tuple[str, ...] = ()
    if hypothesis.noise:
        fixed = ("noise",)
        trials = [replace(scales, noise=noise) for noise in hypothesis.noise]
        scales = max(trials, key=lambda s: system.fit(s, added).log_evidence)
    fit, scales = climb(system, scales, added, fixed=fixed)
    return _judged(hypothesis, system, fit, scales, added)


def _with_amplitudes(
    hypothesis: Hypothesis, readings: Readings, scales: Scales, theta: FloatArray
) -> tuple[System, Scales, Added]:
    """The system about the amplitudes that fit best, and their prior."""
    about = np.zeros(len(hypothesis.parameters))
    size: Size = 0.0
    largest = _ABSURD * max(float(np.max(s)) for s in hypothesis.sizes)
    checks = not readings.test.all()
    for turn in range(_TURNS):
        mended = hypothesis.undo(readings, about)
        use_checks = checks and not hypothesis.blind and sensible(theta, mended)
        system = System(mended, theta if use_checks else None, hypothesis.unused)
        added = Added(hypothesis.columns(readings, theta, about), size, about)
        if turn < 2:
            sizes = [replace(added, size=s) for s in hypothesis.sizes]
            added = max(sizes, key=lambda a: system.fit(scales, a).log_evidence)
            size = added.size
        fit = system.fit(scales, added)
        theta = fit.theta
        moved = np.abs(fit.amplitudes - about).max()
        small = not checks and np.abs(added.columns @ fit.amplitudes).max() < 0.3e-3
        if moved < _STILL_G or moved > largest or small:
            break
        about = fit.amplitudes
    return system, scales, added


def _judged(
    hypothesis: Hypothesis, system: System, fit: Fit, scales: Scales, added: Added | None
) -> Judged:
    evidence = fit.log_evidence + log_prior(hypothesis)
    amplitudes = fit.amplitudes if added is not None else np.zeros(0)
    return Judged(hypothesis, evidence, fit.log_evidence, amplitudes, system, fit, scales, added)
