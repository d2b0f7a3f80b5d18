"""The model of all terms of P0 (13) over temperature, its derivatives and its priors.

    l = K(T)^-1 (U - U0(T)),    a = l + Q p(l)

K and U0 are sums of the functions of a thermal function, Q is one for all temperatures. Each prior
has mean zero: each axis' own square, the other products, the differences of the scales, and the
misalignment of the axes to each other. The mean scale, the biases and the turn to the table are
free.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.model.metrological import force_from_voltage
from triaxcal.model.terms import PRODUCT_AXES, product_slopes, products
from triaxcal.model.types import FloatArray
from triaxcal.unit.priors import Priors

_SD_MIN = 1e-12
"""Of a prior, g/g^2: such a term is left out."""


def quadratic_sd(priors: Priors) -> FloatArray:
    """Standard deviations of Q, shape (3, 6), g/g^2."""
    sd = np.full((3, 6), max(priors.product_g_per_g2, _SD_MIN))
    for k, (i, j) in enumerate(PRODUCT_AXES):
        if i == j:
            sd[i, k] = priors.own_square_g_per_g2
    return sd


@dataclass(frozen=True)
class AllTerms:
    """Readings (n, 3), known force (n, 3), functions (n, P), `gains` of them for K; known Q."""

    readings: FloatArray
    force: FloatArray
    basis: FloatArray
    gains: int
    known: FloatArray

    @property
    def linear(self) -> int:
        """Unknowns of K and U0."""
        return 9 * self.gains + 3 * int(self.basis.shape[1])

    def constants(self, theta: FloatArray) -> FloatArray:
        """Constants (12, P) of the unknowns."""
        count = self.basis.shape[1]
        result = np.zeros((12, count))
        result[:9, : self.gains] = theta[: 9 * self.gains].reshape(9, self.gains)
        result[9:] = theta[9 * self.gains : self.linear].reshape(3, count)
        return result

    def unknowns(self, constants: FloatArray) -> FloatArray:
        """The unknowns of constants, Q zero."""
        parts = (constants[:9, : self.gains].ravel(), constants[9:].ravel(), np.zeros(18))
        return np.concatenate(parts)

    def force_of(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Linear force l and force a, each (n, 3)."""
        linear = force_from_voltage(self.basis @ self.constants(theta).T, self.readings)
        Q = theta[self.linear :].reshape(3, 6) + self.known
        return linear, linear + products(linear) @ Q.T

    def slopes(self, theta: FloatArray) -> FloatArray:
        """Derivatives of the force by the unknowns, shape (n, 3, unknowns)."""
        n, count = self.basis.shape
        linear, _ = self.force_of(theta)
        K = (self.basis @ self.constants(theta).T)[:, :9].reshape(n, 3, 3)
        Q = theta[self.linear :].reshape(3, 6) + self.known
        bent = np.broadcast_to(np.eye(3), (n, 3, 3)) + np.einsum(
            "ik,nkj->nij", Q, product_slopes(linear)
        )
        N = -np.einsum("nij,njk->nik", bent, np.linalg.inv(K))
        of_gain = np.einsum("nik,nl,nf->niklf", N, linear, self.basis[:, : self.gains])
        of_bias = np.einsum("nik,nf->nikf", N, self.basis)
        of_q = np.einsum("ik,nq->nikq", np.eye(3), products(linear))
        return np.concatenate(
            [
                of_gain.reshape(n, 3, 9 * self.gains),
                of_bias.reshape(n, 3, 3 * count),
                of_q.reshape(n, 3, 18),
            ],
            axis=-1,
        )


def prior_rows(
    problem: AllTerms, start: FloatArray, priors: Priors
) -> tuple[FloatArray, FloatArray]:
    """Rows W of the prior and their aims c, |W theta - c|^2: misalignment, scales, Q.

    K = S (1 + E) with S the scales of the linear fit and E in the frame of the table: only its
    symmetric part is misalignment, the other is the turn to the table.
    """
    middle = problem.basis.mean(axis=0)[: problem.gains]
    K0 = (start[:9, : problem.gains] @ middle).reshape(3, 3)
    diagonal = np.diag(K0)
    total = problem.linear + 18
    E = np.zeros((3, 3, total))
    for i in range(3):
        for j in range(3):
            at = (3 * i + j) * problem.gains
            E[i, j, at : at + problem.gains] = middle / diagonal[i]
    rows, aims = [], []
    for i, j in ((0, 1), (0, 2), (1, 2)):
        rows.append((E[i, j] + E[j, i]) / 2.0 / priors.cross_term_rad)
        aims.append(0.0)
    mean = (E[0, 0] + E[1, 1] + E[2, 2]) / 3.0
    relative = np.abs(diagonal) / np.abs(diagonal).mean()
    for i in range(3):
        # E_ii is 1 at the linear fit, whose scales differ by `relative` already.
        rows.append((E[i, i] - mean) / priors.scale_factor)
        aims.append((1.0 - relative[i]) / priors.scale_factor)
    of_q = np.zeros((18, total))
    of_q[:, problem.linear :] = np.diag(1.0 / quadratic_sd(priors).ravel())
    return np.concatenate([np.array(rows), of_q]), np.concatenate([aims, np.zeros(18)])
