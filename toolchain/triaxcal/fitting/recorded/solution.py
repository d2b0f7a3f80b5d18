"""A solution of the scalar model, what is known of it, and what it is without some poses."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from triaxcal.fitting.core.posterior import Posterior
from triaxcal.fitting.recorded.scalar import (
    ScalarData,
    ScalarModel,
    constant_part,
    residual_of,
    split,
)
from triaxcal.model.types import BoolArray, FloatArray

_NEAR = 3e-3
"""Move of a scaled constant whose square, 1e-5 g, is what one step leaves."""


@dataclass(frozen=True)
class ScalarFit:
    """A solution.

    Attributes
    ----------
    model : ScalarModel
    gain_functions : int
        How many of the functions of temperature the entries of K use, the first ones.
    theta : array
        Gains (m, Pg), biases (3, P), quadratic (q,), flat, in scaled readings.
    jacobian : array, shape (n, parameters)
        Weighted, at the solution.
    residual_g : array, shape (n,)
        |a| - g, not weighted.
    posterior : Posterior or None
        Of a fit with priors.
    """

    model: ScalarModel
    gain_functions: int
    theta: FloatArray
    data: ScalarData
    jacobian: FloatArray
    residual_g: FloatArray
    posterior: Posterior | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each parameter."""
        m, P = self.gain_functions, self.data.basis.shape[1]
        names = [_thermal_name(n, p) for n in self.model.gain_names for p in range(m)]
        names += [_thermal_name(f"U0{axis}", p) for axis in "xyz" for p in range(P)]
        return (*names, *(f"quadratic pattern {k + 1}" for k in range(len(self.model.quadratic))))

    @property
    def rms_g(self) -> float:
        """Fit residual, rms over the poses."""
        return float(np.sqrt(np.mean(self.residual_g**2)))

    @cached_property
    def singular(self) -> tuple[FloatArray, FloatArray]:
        """Singular values of the Jacobian with columns of length 1, and right vectors as rows."""
        # An effect below 0.01 g for a constant of 1 is not brought to length 1: it is not seen.
        floor = 0.01 * np.sqrt(len(self.jacobian))
        scaled = self.jacobian / np.maximum(np.linalg.norm(self.jacobian, axis=0), floor)
        if len(scaled) > scaled.shape[1]:  # the triangle has the same singular values
            scaled = np.asarray(np.linalg.qr(scaled, mode="r"))
        _, singular, vt = np.linalg.svd(scaled, full_matrices=True)
        padded = np.zeros(vt.shape[0])
        padded[: len(singular)] = singular
        return padded, vt

    @property
    def condition(self) -> float:
        """Condition number of the scaled Jacobian."""
        singular = self.singular[0]
        return float(singular[0] / singular[-1]) if singular[-1] > 0.0 else float("inf")

    def unseen(self) -> str:
        """Names of the parameters that make up the least visible combination."""
        weakest = np.abs(self.singular[1][-1])
        order = np.argsort(-weakest, kind="stable")
        kept = [self.names[k] for k in order if weakest[k] >= 0.4 * weakest[order[0]]]
        return ", ".join(kept[:4])

    @cached_property
    def variance_g2(self) -> float:
        """Variance of a pose of weight 1 from the residuals."""
        dof = max(len(self.residual_g) - len(self.theta), 1)
        return float(((self.residual_g * self.data.weight) ** 2).sum() / dof)

    @cached_property
    def covariance(self) -> FloatArray:
        """Covariance of theta."""
        if self.posterior is not None:
            return self.posterior.covariance
        inverse = np.linalg.pinv(self.jacobian.T @ self.jacobian).astype(np.float64)
        result: FloatArray = self.variance_g2 * inverse
        return result

    def split(self, theta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """K (P, 3, 3) and bias (P, 3) by function of temperature, and Q (3, 6)."""
        return split(self.model, self.gain_functions, self.data.basis.shape[1], theta)

    def constants(self) -> FloatArray:
        """Twelve constants by function of temperature, shape (12, P), in reading units."""
        return self._constants(self.theta)

    def constants_jacobian(self) -> FloatArray:
        """Derivative of `constants` by theta, shape (12, P, parameters): it is linear."""
        zero = self._constants(np.zeros_like(self.theta))
        columns = [self._constants(unit) - zero for unit in np.eye(len(self.theta))]
        return np.stack(columns, axis=-1)

    def _constants(self, theta: FloatArray) -> FloatArray:
        K, bias, _ = self.split(theta)
        scaled = np.concatenate([K.reshape(len(K), 9), bias], axis=1) * self.data.radius
        # The functions sum to the constant 1 with weight `ones`: the centre belongs to it.
        ones = constant_part(self.data.basis)
        scaled[:, 9:] += ones[:, None] * self.data.centre
        result: FloatArray = scaled.T
        return result

    @property
    def quadratic(self) -> FloatArray:
        """Q, shape (3, 6), 1/g."""
        return self.split(self.theta)[2]

    def without(self, mask: BoolArray) -> Held | None:
        """The fit without the poses of a mask (n,), by one step from this solution.

        At the solution the poses that stay pull against those that go: with A the normal matrix of
        those that stay, the solution moves by A^-1 J^T r of those that go. None where that is too
        far for one step, and where it has no solution.
        """
        factor, ridge, weight = self._inner
        own = self._slopes[mask]
        normal = self._normal - own.T @ own
        values, vectors = np.linalg.eigh(normal)
        if values[0] <= 1e-12 * values[-1]:
            return None
        inverse = (vectors / values) @ vectors.T
        move = factor @ (inverse @ (own.T @ (weight[mask] * self.residual_g[mask])))
        if not np.abs(move).max() < _NEAR:
            return None
        condition = 0.0
        if self.posterior is None:
            scale = 1.0 / np.sqrt(np.maximum(np.diag(normal), 1e-4 * len(mask)))
            scaled = np.linalg.eigvalsh(scale[:, None] * normal * scale)
            condition = float(np.sqrt(scaled[-1] / max(float(scaled[0]), 1e-300)))
        spread: FloatArray = ridge * factor @ inverse @ factor.T
        return Held(self, self.theta + move, spread, condition)

    @property
    def _inner(self) -> tuple[FloatArray, float, FloatArray]:
        """Factor of theta that is solved in, what the prior adds there, and the weights."""
        if self.posterior is None:
            return np.eye(len(self.theta)), 0.0, self.data.weight
        found = self.posterior
        return found.prior.factor, found.scale**2, found.weight

    @cached_property
    def _slopes(self) -> FloatArray:
        factor, _, weight = self._inner
        result: FloatArray = (self.jacobian @ factor) * (weight / self.data.weight)[:, None]
        return result

    @cached_property
    def _normal(self) -> FloatArray:
        ridge = self._inner[1] * np.eye(self._slopes.shape[1])
        result: FloatArray = self._slopes.T @ self._slopes + ridge
        return result

    def held(self) -> Held:
        """These constants, to be tried on other poses."""
        spread = np.zeros((len(self.theta),) * 2)
        if self.posterior is not None:
            spread = self.posterior.spread_covariance
        return Held(self, self.theta, spread, self.condition)


@dataclass(frozen=True)
class Held:
    """Constants that some poses were held out of, to be tried on them.

    Attributes
    ----------
    of : ScalarFit
        The fit that it belongs to.
    theta : array
    spread : array
        Covariance of theta; of a fit with priors.
    condition : float
        Condition number of the scaled Jacobian; of a fit without.
    """

    of: ScalarFit
    theta: FloatArray
    spread: FloatArray
    condition: float

    def errors_g(self, data: ScalarData) -> FloatArray:
        """|a| - g of other poses with these constants, shape (n,)."""
        return residual_of(self.of.model, self.of.gain_functions, data, self.theta)[0]

    def expected_g(self, data: ScalarData) -> FloatArray:
        """Standard deviation of |a| of other poses by these constants, (n,), noise apart."""
        slopes = residual_of(self.of.model, self.of.gain_functions, data, self.theta)[1]
        result: FloatArray = np.sqrt(((slopes @ self.spread) * slopes).sum(axis=1))
        return result


def _thermal_name(name: str, function: int) -> str:
    return name if function == 0 else f"{name} (temperature term {function})"
