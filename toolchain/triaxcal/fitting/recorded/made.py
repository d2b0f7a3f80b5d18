"""The calibration of a recording of poses, from the fit with priors and what goes into the C."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from triaxcal.fitting.core.calibration import Calibration, CalibrationPoint
from triaxcal.fitting.core.judged import HeldOutPoses
from triaxcal.fitting.core.posterior import Posterior
from triaxcal.fitting.core.recorded import (
    LEFT_OUT_PART,
    NO_TERMS_COVARIANCE,
    NOISE_PART,
    PRIOR_PART,
    CovariancePart,
    RecordingFit,
    TermsCovariance,
)
from triaxcal.fitting.recorded.frame import CASE, case_rotation, turned_constants, turned_quadratic
from triaxcal.fitting.recorded.shares import constant_shares
from triaxcal.fitting.recorded.temperatures import recording_range
from triaxcal.fitting.recorded.terms import Delivered
from triaxcal.fitting.recorded.trials import Judged, PoseClimate
from triaxcal.model.metrological import force_from_voltage
from triaxcal.model.terms import RateTerm, Terms
from triaxcal.model.thermal.shape import ThermalShape
from triaxcal.model.types import FloatArray
from triaxcal.poses.poseset import PoseSet
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.recording import RecordingLayout

ESTIMATOR = "|a| = g"


@dataclass(frozen=True)
class Made:
    """What a calibration is put together from.

    Attributes
    ----------
    rows : list of Judged
        The table of candidates.
    linear : Judged
        The linear constants with priors: what the poses see.
    by_orientation : int
        How many of the held-out values, the first ones, are those of orientations.
    held_out : tuple of HeldOutPoses
        Of what is delivered.
    """

    unit: UnitDescription
    layout: RecordingLayout
    poses: PoseSet
    climate: PoseClimate
    rows: list[Judged]
    delivered: Delivered
    linear: Judged
    by_orientation: int
    held_out: tuple[HeldOutPoses, ...]
    why: str
    findings: list[str]
    contradicted: list[str]

    def calibration(self) -> Calibration:
        """The calibration, in the frame of the layout."""
        own, rotation = self.delivered.own, None
        constants, quadratic = own.fit.constants(), own.fit.quadratic
        findings = [*self.contradicted, *self.findings]
        if self.layout.frame == CASE:
            force = force_from_voltage(own.fit.data.basis @ constants.T, self.poses.readings)
            rotation, finding = case_rotation(self.poses.source, force)
            findings.append(finding)
            constants = turned_constants(constants, rotation)
            quadratic = turned_quadratic(quadratic, rotation)
        frame = _Frame(self.delivered, constants, rotation)
        rate, rate_g2 = None, None
        if own.trial.rate:
            rate = self._rate_term(constants)
            rate_g2 = frame.rate_covariance(own.trial.shape.basis(self.unit.t0_degc))
            findings.append(rate_in_words(rate))
            constants = constants[:, :-1]
        parts = frame.parts()
        total = sum(part.covariance for part in parts)
        terms = Terms(quadratic if quadratic.any() else None, rate)
        result = self._recording(np.asarray(total), parts, rate_g2, findings)
        return self._calibration(constants, terms, result)

    def _rate_term(self, constants: FloatArray) -> RateTerm:
        """The biases' last function, reading units at the largest rate, as an offset of a at T0."""
        rates, shape = self.climate.rates, self.delivered.own.trial.shape
        assert rates is not None
        at_t0 = constants[:9, :-1] @ shape.basis(self.unit.t0_degc)
        per_rate = constants[9:, -1] / np.abs(rates).max()
        offset = -np.linalg.solve(at_t0.reshape(3, 3), per_rate).astype(np.float64)
        # A hundredth beyond: the fastest pose must not be clamped by the rounding of its code.
        low, high = 1.01 * min(float(rates.min()), 0.0), 1.01 * max(float(rates.max()), 0.0)
        return RateTerm(offset, (low, high))

    def _recording(
        self,
        covariance: FloatArray,
        parts: tuple[CovariancePart, ...],
        rate_g2: FloatArray | None,
        findings: list[str],
    ) -> RecordingFit:
        own, full = self.delivered.own, self.delivered.full.fit
        posterior = full.posterior
        assert posterior is not None
        return RecordingFit(
            poses=self.poses,
            route=f"only |a| = g known; frame: {self.layout.frame}",
            covariance=covariance,
            dof=posterior.dof,
            rms_g=own.fit.rms_g,
            rms_free_g=posterior.scale,
            held_out_g=own.held_out_g,
            left_out_length_g=own.length_g(self.by_orientation),
            condition=self.linear.fit.condition,
            weakest=self.linear.fit.unseen(),
            residual_g=own.fit.residual_g,
            findings=tuple(findings),
            contradicted=tuple(self.contradicted),
            terms=_sum([part.terms for part in parts], rate_g2),
            parts=parts,
            noise_95_g=posterior.half_width,
            expected_g=own.expected_g,
            held_out_poses=self.by_orientation,
            held_out=self.held_out,
            shares=constant_shares(self.delivered.full, self.unit.t0_degc, self.layout),
        )

    def _calibration(
        self, constants: FloatArray, terms: Terms, result: RecordingFit
    ) -> Calibration:
        own = self.delivered.own
        source = (
            f"fit with priors: noise {result.rms_free_g * 1e3:.3g} mg a pose, "
            f"{result.dof:.3g} degrees of freedom"
        )
        return recorded_calibration(
            self.unit,
            self.layout,
            (own.trial.shape, constants),
            result,
            self.climate.temps_degc,
            estimator=ESTIMATOR,
            covariance_source=source,
            candidates=tuple(r.candidate(ESTIMATOR, chosen=r is own) for r in self.rows),
            selection_reason=self.why,
            terms=terms,
        )


@dataclass(frozen=True)
class _Frame:
    """Errors of the full fit's theta as errors of constants and of Q, in the layout's frame.

    Attributes
    ----------
    constants : array, shape (12, P)
        The delivered ones, with the term in dT/dt.
    rotation : array, shape (3, 3), or None
    """

    delivered: Delivered
    constants: FloatArray
    rotation: FloatArray | None

    @property
    def posterior(self) -> Posterior:
        """Of the full fit."""
        found = self.delivered.full.fit.posterior
        assert found is not None
        return found

    @cached_property
    def slopes(self) -> FloatArray:
        """Constants by theta, (12, P, parameters)."""
        slopes = self.delivered.full.fit.constants_jacobian()
        if self.rotation is None:
            return slopes
        turn = self.rotation
        turned = [turned_constants(slopes[..., k], turn) for k in range(slopes.shape[-1])]
        return np.stack(turned, axis=-1)

    @cached_property
    def patterns(self) -> FloatArray:
        """Q by the last entries of theta, (q, 18)."""
        patterns = self.delivered.full.fit.model.quadratic
        if self.rotation is not None:
            turned = [turned_quadratic(pattern, self.rotation) for pattern in patterns]
            patterns = np.array(turned).reshape(-1, 3, 6)
        return patterns.reshape(-1, 18)

    def parts(self) -> tuple[CovariancePart, ...]:
        """Scatter of the poses, the priors, and the terms that are left out."""
        parts = [
            self._part(NOISE_PART, self.posterior.noise_covariance),
            self._part(PRIOR_PART, self.posterior.prior_covariance),
        ]
        if self.delivered.own is not self.delivered.full:
            shift = self._shift()
            parts.append(self._part(LEFT_OUT_PART, np.outer(shift, shift)))
        return tuple(parts)

    def _part(self, key: str, covariance: FloatArray) -> CovariancePart:
        slopes = self.slopes
        if self.delivered.own.trial.rate:
            slopes = slopes[:, :-1]
        of_constants = np.einsum("apk,kl,bql->apbq", slopes, covariance, slopes, optimize=True)
        terms, count = NO_TERMS_COVARIANCE, len(self.patterns)
        if count:
            mixed = covariance[:, -count:] @ self.patterns
            own = self.patterns.T @ covariance[-count:, -count:] @ self.patterns
            terms = TermsCovariance(own, slopes @ mixed)
        return CovariancePart(key, of_constants, terms)

    def _shift(self) -> FloatArray:
        """Delivered theta less that of the full fit, in the parameters of the full one."""
        own, full = self.delivered.own.fit, self.delivered.full.fit
        count = len(full.theta) - len(full.model.quadratic)
        shift = -full.theta
        shift[:count] += own.theta[:count]
        Q = (own.quadratic - own.model.known).ravel()
        shift[count:] += full.model.quadratic.reshape(-1, 18) @ Q
        return shift

    def rate_covariance(self, basis_t0: FloatArray) -> FloatArray:
        """Covariance (3, 3) of the offset at the largest rate and T0, g^2."""
        at_t0 = self.constants[:9, :-1] @ basis_t0
        offset = np.linalg.solve(at_t0.reshape(3, 3), self.slopes[9:, -1])
        result: FloatArray = offset @ self.posterior.covariance @ offset.T
        return result


def _sum(terms: list[TermsCovariance], rate_g2: FloatArray | None) -> TermsCovariance:
    own = [t.quadratic for t in terms if t.quadratic is not None]
    cross = [t.cross for t in terms if t.cross is not None]
    if not own:
        return TermsCovariance(rate_g2=rate_g2)
    return TermsCovariance(np.sum(own, axis=0), np.sum(cross, axis=0), rate_g2)


def recorded_calibration(
    unit: UnitDescription,
    layout: RecordingLayout,
    curves: tuple[ThermalShape, FloatArray],
    recording: RecordingFit,
    temps_degc: FloatArray,
    **more: Any,
) -> Calibration:
    """The calibration of a recording, from its fit.

    Parameters
    ----------
    curves : tuple of ThermalShape and array, shape (12, P)
        Functions of temperature, and the constants' parameters in them.
    more
        The remaining attributes of `Calibration`.
    """
    shape, constants = curves
    t0, thermal = unit.t0_degc, shape.model(constants)
    basis, covariance = shape.basis(t0), recording.covariance
    at_t0 = np.einsum("p,apbq,q->ab", basis, covariance, basis)
    rms_g = recording.rms_g
    return Calibration(
        serial=unit.serial,
        thermal=thermal,
        shape=shape,
        range_degc=recording_range(unit, recording.poses, temps_degc),
        points=(CalibrationPoint(t0, thermal.constants_at(t0), at_t0, rms_g, rms_g),),
        parameter_covariance=covariance_blocks(covariance),
        check_dwells=(),
        recording=recording,
        reading_unit=layout.acceleration_unit,
        **more,
    )


def rate_in_words(rate: RateTerm) -> str:
    """What a term in dT/dt is, and what the firmware does about it."""
    offset = ", ".join(f"{v * 1e3 / 60.0:.3g}" for v in rate.offset_g_s_per_k)
    low, high = (60.0 * v for v in rate.range_k_per_s)
    return (
        f"a term in dT/dt is fitted: {offset} mg for 1 K/min in x, y, z, from {low:.3g} to "
        f"{high:+.3g} K/min; the firmware gives the rate by triax_set_temperature_rate"
    )


def covariance_blocks(covariance: FloatArray) -> FloatArray:
    """The blocks of each output, (3, 4, P, 4, P), of (12, P, 12, P)."""
    rows = np.array([[3 * i, 3 * i + 1, 3 * i + 2, 9 + i] for i in range(3)])
    return np.stack([covariance[r][:, :, r] for r in rows])
