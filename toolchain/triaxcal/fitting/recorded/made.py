"""The calibration of a recording of poses, from the model that was chosen for it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from triaxcal.fitting.core.calibration import Calibration, CalibrationPoint
from triaxcal.fitting.core.recorded import NO_TERMS_COVARIANCE, RecordingFit, TermsCovariance
from triaxcal.fitting.recorded.frame import CASE, case_rotation, turned_constants, turned_quadratic
from triaxcal.fitting.recorded.temperatures import (
    recording_range,
)
from triaxcal.fitting.recorded.trials import (
    Judged,
    PoseClimate,
)
from triaxcal.model.metrological import force_from_voltage
from triaxcal.model.terms import RateTerm, Terms
from triaxcal.model.thermal.shape import ThermalShape
from triaxcal.model.types import FloatArray
from triaxcal.poses.poses import PoseSet
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.recording import RecordingLayout

ESTIMATOR = "|a| = g"
_UNCHECKED = (
    "NOT CHECKED: {count} constants fit any {count} poses exactly, so the residuals are 0 and show "
    "nothing; the uncertainty of the constants is unknown; record more poses, in other orientations"
)


@dataclass(frozen=True)
class Made:
    """What a calibration is put together from."""

    unit: UnitDescription
    layout: RecordingLayout
    poses: PoseSet
    climate: PoseClimate
    rows: list[Judged]
    best: Judged
    why: str
    findings: list[str]

    def calibration(self) -> Calibration:
        """The calibration, in the frame of the layout."""
        fit = self.best.fit
        constants, slopes = fit.constants(), fit.constants_jacobian()
        quadratic, patterns = fit.quadratic, fit.model.quadratic
        findings = list(self.findings)
        if self.layout.frame == CASE:
            force = force_from_voltage(fit.data.basis @ constants.T, self.poses.readings)
            rotation, finding = case_rotation(self.poses.source, force)
            findings.append(finding)
            constants = turned_constants(constants, rotation)
            quadratic = turned_quadratic(quadratic, rotation)
            patterns = np.array([turned_quadratic(pattern, rotation) for pattern in patterns])
            turned = [turned_constants(slopes[..., k], rotation) for k in range(slopes.shape[-1])]
            slopes = np.stack(turned, axis=-1)
        rate = self._rate_term(constants) if self.best.trial.rate else None
        known = NO_TERMS_COVARIANCE
        if len(patterns):
            count, pattern = len(patterns), patterns.reshape(-1, 18)
            mixed = fit.covariance[:, -count:] @ pattern
            own = pattern.T @ fit.covariance[-count:, -count:] @ pattern
            known = TermsCovariance(own, slopes @ mixed)
        if rate is not None:
            known = TermsCovariance(rate_g2=self._rate_covariance(constants, slopes))
            findings.append(rate_in_words(rate))
            constants, slopes = constants[:, :-1], slopes[:, :-1]
        covariance = np.einsum("apk,kl,bql->apbq", slopes, fit.covariance, slopes)
        if len(fit.residual_g) == len(fit.theta):
            covariance = np.full_like(covariance, np.nan)
            findings.insert(0, _UNCHECKED.format(count=len(fit.theta)))
        terms = Terms(quadratic if quadratic.any() else None, rate)
        return self._calibration(constants, terms, covariance, known, findings)

    def _rate_term(self, constants: FloatArray) -> RateTerm:
        """The biases' last function, reading units at the largest rate, as an offset of a at T0."""
        rates, shape = self.climate.rates, self.best.trial.shape
        assert rates is not None
        at_t0 = constants[:9, :-1] @ shape.basis(self.unit.t0_degc)
        per_rate = constants[9:, -1] / np.abs(rates).max()
        offset = -np.linalg.solve(at_t0.reshape(3, 3), per_rate).astype(np.float64)
        # A hundredth beyond: the fastest pose must not be clamped by the rounding of its code.
        low, high = 1.01 * min(float(rates.min()), 0.0), 1.01 * max(float(rates.max()), 0.0)
        return RateTerm(offset, (low, high))

    def _rate_covariance(self, constants: FloatArray, slopes: FloatArray) -> FloatArray:
        """Covariance (3, 3) of the offset at the largest rate and T0, g^2."""
        at_t0 = constants[:9, :-1] @ self.best.trial.shape.basis(self.unit.t0_degc)
        offset = np.linalg.solve(at_t0.reshape(3, 3), slopes[9:, -1])
        result: FloatArray = offset @ self.best.fit.covariance @ offset.T
        return result

    def _calibration(
        self,
        constants: FloatArray,
        terms: Terms,
        covariance: FloatArray,
        known: TermsCovariance,
        findings: list[str],
    ) -> Calibration:
        fit, shape = self.best.fit, self.best.trial.shape
        dof = len(fit.residual_g) - len(fit.theta)
        result = RecordingFit(
            poses=self.poses,
            route=f"only |a| = g known; frame: {self.layout.frame}",
            covariance=covariance,
            dof=dof,
            rms_g=fit.rms_g,
            rms_free_g=math.sqrt(float((fit.residual_g**2).sum()) / dof) if dof else math.nan,
            held_out_g=self.best.held_out_g,
            left_out_length_g=self.best.length_g(len(self.poses.poses)),
            condition=fit.condition,
            weakest=fit.unseen(),
            residual_g=fit.residual_g,
            findings=tuple(findings),
            terms=known,
        )
        freedom = f"{dof} degree{'s' * (dof != 1)} of freedom"
        return recorded_calibration(
            self.unit,
            self.layout,
            (shape, constants),
            result,
            self.climate.temps_degc,
            estimator=ESTIMATOR,
            covariance_source=f"scatter of |a| - g over the poses, {freedom}",
            candidates=tuple(r.candidate(ESTIMATOR, chosen=r is self.best) for r in self.rows),
            selection_reason=self.why,
            terms=terms,
        )


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
