"""Quick evidence of many hypotheses on the same readings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from triaxcal.diagnosis.core.cause import Hypothesis, either, unchanged
from triaxcal.diagnosis.core.curves import ORDERS, powers, prior_sd
from triaxcal.diagnosis.core.evidence import linked, log_prior
from triaxcal.diagnosis.core.readings import POSITIONS, Readings
from triaxcal.diagnosis.core.scales import Scales
from triaxcal.diagnosis.core.scales import log_prior as log_prior_of_scales
from triaxcal.diagnosis.core.sound import ROUNDING, SQUARE_SD, WIDE, Added, Fit, System
from triaxcal.model.types import BoolArray, FloatArray

_REFUTED = -30.0
"""Log evidence of the test positions against a sound unit; no check dwells make up for it."""
_STANDS_OUT = 12.0
"""Squared, in standard deviations."""


@dataclass(frozen=True)
class Screened:
    """A hypothesis with its quick evidence, and the scales that gave it."""

    hypothesis: Hypothesis
    log_evidence: float
    scales: Scales


class Screen:
    """Quick evidence of many hypotheses on the same readings, at a few settings of the scales.

    `added` are amplitudes of a cause that has been found, and taken off the readings.
    """

    def __init__(
        self, system: System, settings: Sequence[Scales], added: Added | None = None
    ) -> None:
        self.system, self.readings, self.added = system, system.readings, added
        self.settings = tuple(dict.fromkeys(settings))
        fits = [system.fit(s, added) for s in self.settings]
        self.theta = max(fits, key=lambda f: f.log_evidence).theta
        self._parts = [self._part(s, f) for s, f in zip(self.settings, fits, strict=True)]
        # The mistake has spoiled the scales that fit the readings as they are.
        self._firm = tuple(dict.fromkeys(replace(s, bend=0.0) for s in self.settings))
        self._tests_alone = max(log_evidence_of_tests(self.readings, self._firm, system.unused))
        self._unchanged = [system.fit(s, added).log_evidence for s in self._firm]
        self._of_added = max(self._unchanged) - max(system.fit(s).log_evidence for s in self._firm)

    def _part(self, scales: Scales, fit: Fit) -> tuple[float, FloatArray, FloatArray, FloatArray]:
        root = 1.0 / np.sqrt(self.system.row_variance(scales))
        projector = np.asarray(np.linalg.solve(fit.root, fit.columns.T))
        return fit.log_evidence, root, projector, fit.residual

    def score(self, hypothesis: Hypothesis) -> Screened:
        """Quick evidence of a hypothesis."""
        if hypothesis.noise:
            start = replace(self.settings[-1], bend=0.0)
            scales = [replace(start, noise=n) for n in hypothesis.noise]
            values = [self.system.fit(s, self.added).log_evidence for s in scales]
        elif hypothesis.parameters:
            values, scales = self._additive(hypothesis), list(self.settings)
        else:
            values, scales = self._discrete(hypothesis), list(self._firm)
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
        Q, b = [], []
        for _, root, projector, rest in self._parts:
            scaled = root[:, None] * extra
            inner = projector @ scaled
            Q.append(scaled.T @ scaled - inner.T @ inner)
            b.append(scaled.T @ rest)
        # Settings, sizes, amplitudes: all at once.
        count = len(about)
        variance = np.array([np.broadcast_to(size, count) for size in hypothesis.sizes]) ** 2
        A = np.array(Q)[:, None] * variance[:, None, :] + np.eye(count)
        right = np.array(b)[:, None, :, None]
        found = np.linalg.solve(A, np.broadcast_to(right, (*A.shape[:3], 1)))[..., 0]
        gain = 0.5 * (variance * right[..., 0] * found).sum(axis=2)
        values = np.array([part[0] for part in self._parts])[:, None]
        each = values - 0.5 * np.linalg.slogdet(A)[1] + gain
        return [float(value) for value in each.max(axis=1)]

    def _discrete(self, hypothesis: Hypothesis) -> list[float]:
        """Evidence of one without amplitudes, at the settings without bends.

        Test positions are quick; the check dwells are asked only where those allow it.
        """
        if hypothesis.undo is unchanged and hypothesis.unused is None:
            return self._unchanged
        if self.system.unused is not None:
            unused = either(self.system.unused, hypothesis.unused)
            hypothesis = replace(hypothesis, unused=unused)
        mended = hypothesis.undo(self.readings, np.zeros(0))
        alone = log_evidence_of_tests(mended, self._firm, hypothesis.unused)
        if self.readings.test.all() or hypothesis.blind:
            return [value + self._of_added for value in alone]
        gained = max(alone) + hypothesis.log_density - self._tests_alone
        if gained < _REFUTED:
            return [max(self._unchanged) + value - self._tests_alone for value in alone]
        system = linked(mended, self._firm[-1], hypothesis=hypothesis)
        return [system.fit(s).log_evidence + self._of_added for s in self._firm]


def log_evidence_of_tests(
    readings: Readings, settings: Sequence[Scales], unused: BoolArray | None
) -> list[float]:
    """Evidence of the test positions alone, as `System.fit` without bends has it, but sooner.

    At each of the settings. Without check dwells the three outputs have no parameter in common.
    """
    test = readings.test
    force, outputs = readings.force[test], readings.outputs[test]
    count = len(force)
    basis = powers(readings.temps_degc[test], readings.t0_degc)
    one = np.concatenate([np.ones((count, 1)), force], axis=1)
    used = np.ones((count, 3), dtype=np.bool_) if unused is None else ~unused[test]
    level = ((np.abs(force) < 0.5) & used).T
    noise, tilt, seat = (
        np.array([[[getattr(s, name)]] for s in settings]) for name in ("noise", "tilt", "seat")
    )
    variance = np.where(used.T, (readings.sd[test].T * noise) ** 2, WIDE)
    root = used.T / np.sqrt(variance + np.where(level, tilt**2, 0.0))
    names = np.array([p for p, t in zip(readings.positions, test, strict=True) if t])
    own = np.array([names == p for p in POSITIONS]).T
    first = 4 * ORDERS
    sd = np.array([prior_sd(s).reshape(3, 1, first) for s in settings])
    whole = np.empty((len(settings), 3, count, first + len(POSITIONS) + 2))
    whole[..., :first] = (one[:, :, None] * basis[:, None, :]).reshape(count, first) * sd
    whole[..., first] = SQUARE_SD * force.T**2
    whole[..., first + 1 : -1] = (own * level[:, :, None]) * seat[..., None]
    whole[..., -1] = (outputs - force).T
    whole *= root[..., None]
    A = np.swapaxes(whole, 2, 3) @ whole
    diagonal = np.einsum("...jj->...j", A)
    diagonal[..., :-1] += 1.0
    floor = ROUNDING * (1.0 + diagonal[..., -1])
    diagonal[..., -1] += floor
    ends = np.einsum("...jj->...j", np.linalg.cholesky(A))
    unexplained = (ends[..., -1] ** 2 - floor).sum(axis=1)
    norm = np.log(np.where(used.T, root, 1.0 / np.sqrt(WIDE))).sum(axis=(1, 2))
    norm -= np.log(ends[..., :-1]).sum(axis=(1, 2))
    evidence = -0.5 * unexplained + norm - 1.5 * count * np.log(2.0 * np.pi)
    return [float(e) + log_prior_of_scales(s) for e, s in zip(evidence, settings, strict=True)]
