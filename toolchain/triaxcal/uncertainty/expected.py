"""What a delivered calibration leads one to expect of |a| - g at new poses.

The error of |a| at pose i is w_i . vec(D), with D the error of the force (`.propagation`), w_i of
the pose's direction (`.orientation`), and what is new in the pose: the noise of its mean, the
scatter of a pose about the model, one code. So

    cov(r) = R + sum over the sources s of F_s F_s^T,    row i of F_s = w_i . V_s(T_i)^(1/2)

R being diagonal. The symmetric root of the covariance V_s(T) of D makes a source's errors at two
temperatures as correlated as they can be; at one temperature it is exact. The inverse of cov(r) is
taken by the formula of Woodbury, linear in the number of poses.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.core.outliers import fisher_tail
from triaxcal.fitting.field.force import force_and_slopes
from triaxcal.fitting.field.poses import FieldPoses
from triaxcal.model.types import FloatArray
from triaxcal.readings.measurements import MeasurementSet
from triaxcal.uncertainty.evaluate import Uncertainty, uncertainty
from triaxcal.uncertainty.orientation import weights
from triaxcal.uncertainty.source import Source
from triaxcal.unit.description import UnitDescription

OF_THE_POSE = frozenset({"raw_code", "temperature_code", "model"})
"""Sources that are new in each pose; they are part of R here."""
_STEP_DEGC = 0.1
"""Covariances are evaluated at temperatures rounded to this."""
_DOF_MAX = 10**6


@dataclass(frozen=True)
class Expected:
    """Errors of |a| at poses, and what is expected of them.

    Attributes
    ----------
    error_g : array, shape (n,)
        |a| - g by the fitted model.
    force_g : array, shape (n, 3)
    own_sd_g : array, shape (n,)
        Root of R: what is new in each pose.
    factor_g : array, shape (n, m)
        F of all sources beside each other.
    dof : int
        Effective degrees of freedom of chi-square, by Welch and Satterthwaite: a source has the
        share tr(cov(r)^-1 cov_s) / n of it.
    """

    error_g: FloatArray
    force_g: FloatArray
    own_sd_g: FloatArray
    factor_g: FloatArray
    dof: int

    @cached_property
    def sd_g(self) -> FloatArray:
        """Standard uncertainty of each error, shape (n,)."""
        result: FloatArray = np.sqrt(self.own_sd_g**2 + (self.factor_g**2).sum(axis=1))
        return result

    def solve(self, right: FloatArray) -> FloatArray:
        """cov(r)^-1 times (n,) or (n, k)."""
        columns = right.reshape(len(right), -1) / self.own_sd_g[:, None]
        scaled = self.factor_g / self.own_sd_g[:, None]
        inner = np.eye(scaled.shape[1]) + scaled.T @ scaled
        columns = columns - scaled @ np.linalg.solve(inner, scaled.T @ columns)
        result: FloatArray = (columns / self.own_sd_g[:, None]).reshape(right.shape)
        return result

    @cached_property
    def chi_square(self) -> float:
        """r^T cov(r)^-1 r."""
        return float(self.error_g @ self.solve(self.error_g))

    def without(self, index: int) -> Expected:
        """The same without one pose."""
        kept = np.arange(len(self.error_g)) != index
        return Expected(
            self.error_g[kept],
            self.force_g[kept],
            self.own_sd_g[kept],
            self.factor_g[kept],
            self.dof,
        )

    @cached_property
    def left_out(self) -> FloatArray:
        """Each error against what the others predict, in standard deviations, shape (n,).

        With P the inverse of cov(r): (P r)_i / sqrt(P_ii).
        """
        inverse = self.solve(np.eye(len(self.error_g)))
        result: FloatArray = (inverse @ self.error_g) / np.sqrt(np.diag(inverse))
        return result


def chance_of(chi_square: float, count: int, dof: int) -> float:
    """Chance of a chi-square of `count` values as large; 1 where it is below what is expected."""
    if count < 1 or chi_square <= count:
        return 1.0
    return fisher_tail(count, dof, chi_square / count)


def exceeded_with(chance: float, count: int, dof: int) -> float:
    """Chi-square of `count` values that is exceeded with a chance (`chance_of`)."""
    low, high = 1.0, 1e6
    for _ in range(60):
        middle = math.sqrt(low * high)
        over = chance_of(middle * count, count, dof) >= chance
        low, high = (middle, high) if over else (low, middle)
    return high * count


@dataclass(frozen=True)
class Expectation:
    """What a calibration leads one to expect at some temperatures, whatever the readings are.

    Attributes
    ----------
    unit : UnitDescription
    calibration : Calibration
    known : Uncertainty
        At `known.temps_degc`, which hold those of the poses.
    roots : dict of arrays, each of shape (temperatures, m, m)
        V_s(T)^(1/2) of the sources that all poses share, by their keys.
    dofs : tuple of float
        Of these sources.
    """

    unit: UnitDescription
    calibration: Calibration
    known: Uncertainty
    roots: dict[str, FloatArray]
    dofs: tuple[float, ...]

    def at(self, poses: FieldPoses, gravity_g: float) -> Expected:
        """Errors of |a| at poses, and their covariance."""
        calibration = self.calibration
        force, slopes = force_and_slopes(calibration, poses.readings, poses.temps_degc)
        length = np.linalg.norm(force, axis=1)
        factors = [self.factor(key, poses, force) for key in self.roots]
        own, own_dof = _own_variance(self.unit, calibration, self.known, poses, slopes)
        found = Expected(
            error_g=length - gravity_g,
            force_g=force,
            own_sd_g=np.sqrt(own),
            factor_g=np.concatenate([*factors, np.zeros((len(own), 1))], axis=1),
            dof=_DOF_MAX,
        )
        shares = [float((F * found.solve(F)).sum()) / len(own) for F in factors]
        dofs = (*self.dofs, own_dof)
        loss = math.fsum(
            share**2 / dof for share, dof in zip((*shares, 1.0 - sum(shares)), dofs, strict=True)
        )
        return replace(found, dof=max(1, int(1.0 / max(loss, 1.0 / _DOF_MAX))))

    def factor(self, key: str, poses: FieldPoses, force_g: FloatArray) -> FloatArray:
        """F of a source: rows of the poses by the roots of its covariances, (n, 12 or 30)."""
        root = self.roots[key]
        index = np.searchsorted(self.known.temps_degc, _rounded(self.calibration, poses.temps_degc))
        direction = force_g / np.linalg.norm(force_g, axis=1, keepdims=True)
        w = weights(direction, root.shape[-1] // 3)[:, 3]
        result: FloatArray = np.einsum("na,nab->nb", w, root[index])
        return result


def expectation(
    unit: UnitDescription,
    measurements: MeasurementSet,
    calibration: Calibration,
    temps_degc: FloatArray,
) -> Expectation:
    """What is expected at poses of these temperatures, within the range.

    Raises
    ------
    RefusedError
        When the calibration does not know its uncertainty.
    """
    recording = calibration.recording
    if recording is not None and not recording.checked:
        raise RefusedError(
            f"calibration of {calibration.serial}",
            "its uncertainty is unknown: it has as many constants as poses",
            expected="a calibration with more poses than constants",
            remedy="calibrate the unit with more poses",
        )
    grid = np.unique([*_rounded(calibration, temps_degc).tolist(), unit.t0_degc])
    known = uncertainty(unit, measurements, calibration, None, grid)
    shared = [s for s in known.sources if s.force is not None and s.key not in OF_THE_POSE]
    roots, dofs = {s.key: _root(s) for s in shared}, tuple(s.dof for s in shared)
    return Expectation(unit, calibration, known, roots, dofs)


def _rounded(calibration: Calibration, temps_degc: FloatArray) -> FloatArray:
    result: FloatArray = np.round(temps_degc / _STEP_DEGC) * _STEP_DEGC
    return result.clip(*calibration.range_degc)


def _root(source: Source) -> FloatArray:
    """Symmetric roots of the covariances of D."""
    assert source.force is not None
    values, vectors = np.linalg.eigh(source.force)
    result: FloatArray = (vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]) @ np.swapaxes(
        vectors, 1, 2
    )
    return result


def _own_variance(
    unit: UnitDescription,
    calibration: Calibration,
    known: Uncertainty,
    poses: FieldPoses,
    slopes: FloatArray,
) -> tuple[FloatArray, float]:
    """R (n,), g^2: noise of the mean and one code, or the scatter of the calibration's own poses.

    The larger of both: what poses scattered by beyond their noise, they will scatter by again.
    """
    code = np.full(3, unit.adc.volts_per_code**2 / 12.0)
    recording, scatter = calibration.recording, known.scatter
    typical = np.zeros(3) if scatter is None else scatter.variance_v2.mean(axis=0)
    noise = np.where(np.isnan(poses.sd), typical, poses.sd**2)
    variance = (slopes**2 * (noise + code)).sum(axis=1)
    least, dof = 0.0, math.inf
    if recording is not None:
        model = sum(s.sd or 0.0 for s in known.sources if s.key == "model")
        least, dof = recording.rms_free_g**2 + model**2, float(recording.dof)
    elif scatter is not None:
        dof = scatter.noise_dof
    return np.maximum(variance, least), dof if (variance < least).any() else math.inf
