"""The evidence of a hypothesis: quickly for all of them, carefully for the few that matter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from triaxcal.diagnosis.core.cause import Hypothesis
from triaxcal.diagnosis.core.readings import Readings
from triaxcal.diagnosis.core.sound import (
    SCALE_NAMES,
    Added,
    Fit,
    Scales,
    System,
    constants,
    nearby,
    seen_force,
)
from triaxcal.model.types import FloatArray

FAULT_LOG_ODDS = -5.0
"""Before the data, of each cause against a sound unit: one unit in 150 has it.

All causes together make it one unit in six, as of units whose readings somebody looks into.
"""
_ROUNDS = 2
_TURNS = 6
_CONDITION_MAX = 4.0
"""Of K with unit rows, beyond which the constants say nothing about the check dwells."""
_STILL_G = 3e-6
_STANDS_OUT = 12.0
"""Squared, in standard deviations."""
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
        if not _sensible(theta, readings):
            return System(readings, None, unused)
        system = System(readings, theta, unused)
        theta = system.fit(scales).theta
    return system


def _sensible(theta: FloatArray, readings: Readings) -> bool:
    """Whether K is near the identity wherever there are check dwells."""
    K = constants(theta, readings.temps_degc, readings.t0_degc)[:, :, 1:]
    lengths = np.linalg.norm(K, axis=2)
    if not np.isfinite(K).all() or (lengths < 0.3).any() or (lengths > 3.0).any():
        return False
    return bool((np.linalg.cond(K / lengths[:, :, None]) < _CONDITION_MAX).all())


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
    if hypothesis.parameters:
        return _with_amplitudes(hypothesis, readings, start, theta)
    nothing = np.zeros(0)
    mended = hypothesis.undo(readings, nothing)
    noises = hypothesis.noise or (start.noise,)
    fixed = ("noise",) if hypothesis.noise else ()
    system = linked(mended, replace(start, noise=noises[0]), hypothesis=hypothesis)
    trials = [replace(start, noise=noise) for noise in noises]
    scales = max(trials, key=lambda s: system.fit(s).log_evidence)
    fit, scales = climb(system, scales, fixed=fixed)
    return _judged(hypothesis, system, fit, scales, None)


def _with_amplitudes(
    hypothesis: Hypothesis, readings: Readings, scales: Scales, theta: FloatArray
) -> Judged:
    about = np.zeros(len(hypothesis.parameters))
    size = 0.0
    checks = not readings.test.all()
    for turn in range(_TURNS):
        mended = hypothesis.undo(readings, about)
        use_checks = checks and not hypothesis.blind and _sensible(theta, mended)
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
        if moved < _STILL_G or moved > _ABSURD * max(hypothesis.sizes) or small:
            break
        about = fit.amplitudes
    fit, scales = climb(system, scales, added)
    return _judged(hypothesis, system, fit, scales, added)


def _judged(
    hypothesis: Hypothesis, system: System, fit: Fit, scales: Scales, added: Added | None
) -> Judged:
    evidence = fit.log_evidence + log_prior(hypothesis)
    amplitudes = fit.amplitudes if added is not None else np.zeros(0)
    return Judged(hypothesis, evidence, fit.log_evidence, amplitudes, system, fit, scales, added)


@dataclass(frozen=True)
class Screened:
    """A hypothesis with its quick evidence, and the scales that gave it."""

    hypothesis: Hypothesis
    log_evidence: float
    scales: Scales


class Screen:
    """Quick evidence of many hypotheses on the same readings, at a few settings of the scales."""

    def __init__(self, system: System, settings: Sequence[Scales]) -> None:
        self.system, self.readings = system, system.readings
        self.settings = tuple(dict.fromkeys(settings))
        fits = [system.fit(s) for s in self.settings]
        self.theta = max(fits, key=lambda f: f.log_evidence).theta
        self._parts = [self._part(s, f) for s, f in zip(self.settings, fits, strict=True)]
        self._plain = replace(settings[-1], bend=0.0)
        self._tests = System(self.readings, None)
        self._tests_alone = self._tests.fit(self._plain).log_evidence
        self._fit = system.fit(self._plain).log_evidence

    def _part(self, scales: Scales, fit: Fit) -> tuple[float, FloatArray, FloatArray, FloatArray]:
        G, sd = self.system.columns(scales)
        root = 1.0 / np.sqrt(self.system.row_variance(scales))
        projector = np.asarray(np.linalg.solve(fit.root, ((root[:, None] * G) * sd).T))
        return fit.log_evidence, root, projector, fit.residual

    def score(self, hypothesis: Hypothesis) -> Screened:
        """Quick evidence of a hypothesis."""
        if hypothesis.noise:
            start = replace(self.settings[-1], bend=0.0)
            scales = [replace(start, noise=n) for n in hypothesis.noise]
            values = [self.system.fit(s).log_evidence for s in scales]
        elif hypothesis.parameters:
            values, scales = self._additive(hypothesis), list(self.settings)
        else:
            values, scales = [self._discrete(hypothesis)], [self._plain]
        best = int(np.argmax(values))
        return Screened(hypothesis, values[best] + log_prior(hypothesis), scales[best])

    def standing_out(self, most: int) -> tuple[tuple[int, int], ...]:
        """Dwell and output that stand out most, then most when that is left out, and so on."""
        Q, b = self._information
        found: list[tuple[int, int]] = []
        for _ in range(most):
            gain = self._gain(Q, b)
            r = int(gain.argmax())
            if gain[r] < _STANDS_OUT:
                break
            found.append(self._place(r))
            b = b - Q[:, r] * b[r] / Q[r, r]
            Q = Q - np.outer(Q[:, r], Q[r]) / Q[r, r]
        return tuple(found)

    def odd_dwells(self, most: int) -> tuple[int, ...]:
        """The dwells that stand out most, each compared with all others."""
        order = np.argsort(-self._gain(*self._information))
        dwells = dict.fromkeys(self._place(int(r))[0] for r in order[: 3 * most])
        return tuple(dwells)[:most]

    @cached_property
    def _information(self) -> tuple[FloatArray, FloatArray]:
        """Of a shift of each row: inverse variance, shape (n, n), and that times the shift."""
        _, root, projector, rest = self._parts[min(1, len(self._parts) - 1)]
        inner = projector * root
        return np.diag(root**2) - inner.T @ inner, root * rest

    def _gain(self, Q: FloatArray, b: FloatArray) -> FloatArray:
        """Twice the log likelihood that a shift of each row gains."""
        diagonal = np.diag(Q)
        known = self.system.used & (diagonal > 1e-6 * np.diag(self._information[0]))
        return np.where(known, b**2 / np.maximum(diagonal, 1e-12), 0.0)

    def _place(self, row: int) -> tuple[int, int]:
        """Dwell and output of a row; of a check dwell the output that feels most of the force."""
        dwell, output = int(self.system.rows.dwell[row]), int(self.system.rows.output[row])
        if output < 0:
            output = int(np.abs(self.readings.force[dwell]).argmax())
        return dwell, output

    def _additive(self, hypothesis: Hypothesis) -> list[float]:
        """Evidence of one whose amplitudes are taken as small, at each setting."""
        about = np.zeros(len(hypothesis.parameters))
        theta = self.system.linear_about if self.system.linear_about is not None else self.theta
        extra = hypothesis.columns(self.readings, theta, about) * self.system.used[:, None]
        values = []
        for base, root, projector, rest in self._parts:
            scaled = root[:, None] * extra
            inner = projector @ scaled
            Q, b = scaled.T @ scaled - inner.T @ inner, scaled.T @ rest
            each = []
            for size in hypothesis.sizes:
                A = size**2 * Q
                A.flat[:: len(A) + 1] += 1.0
                gain = 0.5 * size**2 * b @ np.linalg.solve(A, b)
                each.append(base - 0.5 * np.linalg.slogdet(A)[1] + gain)
            values.append(float(max(each)))
        return values

    def _discrete(self, hypothesis: Hypothesis) -> float:
        """Evidence of one without amplitudes; the check dwells only where the tests allow it."""
        mended = hypothesis.undo(self.readings, np.zeros(0))
        alone = System(mended, None, hypothesis.unused).fit(self._plain)
        if self.readings.test.all() or hypothesis.blind:
            return alone.log_evidence
        if alone.log_evidence + hypothesis.log_density < self._tests_alone - 30.0:
            return self._fit + alone.log_evidence - self._tests_alone
        return linked(mended, self._plain, alone.theta, hypothesis).fit(self._plain).log_evidence


def standing_force(readings: Readings, theta: FloatArray) -> Readings:
    """The readings, with the force in check positions as the unit sees it."""
    if readings.test.all():
        return readings
    try:
        seen = seen_force(readings, theta)
    except np.linalg.LinAlgError:
        seen = readings.outputs
    return readings.but(force=np.where(readings.test[:, None], readings.force, seen))
