"""A sound unit: curves over temperature, a rig that places it nearly right, and noise.

Outputs in g are y = U0(T) + K(T) a + noise. U0 and K are polynomials over temperature whose
curvature is shrunk, and may bend a little more freely than polynomials do; each position has a
small tilt of its own that is the same at every temperature, and each dwell a smaller one. Each of
these has a prior that is normal with mean zero and a scale (`Scales`), so that the evidence is in
closed form: with G the columns of all parameters, L their prior variances and W the variances of
the rows, y is normal with the covariance W + G L G'.

A check dwell tells only |a| = g: one row, linear in the constants about those of a first fit.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from triaxcal.diagnosis.core.curves import (
    MEAN,
    BendFeatures,
    constants,
    powers,
    prior_sd,
    seen_force,
)
from triaxcal.diagnosis.core.readings import POSITIONS, Readings
from triaxcal.diagnosis.core.scales import Scales, log_prior
from triaxcal.model.types import BoolArray, FloatArray, IntArray

SQUARE_SD = 1e-4
"""Of an own-axis square that nobody would notice, g/g^2."""
WIDE = 1.0
"""Variance, g^2, of a row that the model does not use."""
ROUNDING = 1e-8
"""Of the squares of the rows, added and taken away again: what rounding could make negative."""


@dataclass(frozen=True)
class Rows:
    """Which row of the model is what.

    Attributes
    ----------
    dwell : array of int, shape (n,)
    output : array of int, shape (n,)
        0 to 2; -1 for a check dwell.
    """

    dwell: IntArray
    output: IntArray

    @classmethod
    def of(cls, readings: Readings) -> Rows:
        """Three rows a dwell in a test position, then one a check dwell."""
        tests, checks = np.flatnonzero(readings.test), np.flatnonzero(~readings.test)
        return cls(
            np.concatenate([np.repeat(tests, 3), checks]),
            np.concatenate([np.tile(np.arange(3), len(tests)), np.full(len(checks), -1)]),
        )


@dataclass(frozen=True)
class Added:
    """Columns of a cause beside those of a sound unit.

    Attributes
    ----------
    columns : array, shape (n, k)
    size : float or array, shape (k,)
        Prior standard deviation of the amplitudes, mean zero.
    about : array, shape (k,)
        Amplitudes that have been taken off the readings already.
    """

    columns: FloatArray
    size: float | FloatArray
    about: FloatArray


@dataclass(frozen=True)
class Fit:
    """Constants and amplitudes that are most probable, and how probable the readings are.

    Attributes
    ----------
    log_evidence : float
    squares : float
        y' C^-1 y with the covariance C of the rows: as many as there are rows, on average.
    added : int
        How many of the parameters are amplitudes: the last ones.
    columns, observed : arrays, shapes (n, p) and (n,)
        Of the rows in their standard deviations, and of parameters in theirs.
    root, projected : arrays, shapes (p, p) and (p,)
        Cholesky root L of the inverse covariance of the parameters, and L^-1 G' y.
    scale : array, shape (p,)
        Prior standard deviations of the parameters.
    """

    log_evidence: float
    squares: float
    added: int
    columns: FloatArray
    observed: FloatArray
    root: FloatArray
    projected: FloatArray
    scale: FloatArray

    @cached_property
    def _scaled(self) -> FloatArray:
        return np.asarray(np.linalg.solve(self.root.T, self.projected))

    @property
    def values(self) -> FloatArray:
        """Of all parameters, less their prior means, shape (p,)."""
        return self._scaled * self.scale

    @cached_property
    def residual(self) -> FloatArray:
        """Of the rows in their standard deviations, shape (n,)."""
        return self.observed - self.columns @ self._scaled

    @property
    def theta(self) -> FloatArray:
        """Constants, shape (3 * 4 * ORDERS,)."""
        return np.asarray(self.values[: MEAN.size] + MEAN.ravel())

    @property
    def amplitudes(self) -> FloatArray:
        """Of the added columns, shape (k,)."""
        return self.values[len(self.values) - self.added :]

    @property
    def amplitude_sd(self) -> FloatArray:
        """Their standard deviations."""
        first = len(self.scale) - self.added
        corner = np.linalg.inv(self.root)[:, first:]
        return np.asarray(np.sqrt((corner**2).sum(axis=0)) * self.scale[first:])


class System:
    """The linear model of one version of the readings.

    Parameters
    ----------
    readings : Readings
    theta : array or None
        Constants about which the check dwells are linear; None leaves them unused.
    unused : array of bool, shape (dwells, 3), or None
        Outputs that something else explains.
    """

    def __init__(
        self, readings: Readings, theta: FloatArray | None, unused: BoolArray | None = None
    ) -> None:
        self.readings, self.linear_about, self.unused = readings, theta, unused
        self.rows = rows = Rows.of(readings)
        test = readings.test
        tests = int(test.sum())
        one = np.column_stack([np.ones(tests), readings.force[test]])
        basis = powers(readings.temps_degc, readings.t0_degc)
        own = np.einsum("nc,np->ncp", one, basis[test]).reshape(tests, -1)
        count = own.shape[1]
        G = np.zeros((tests, 3, 3 * count))
        for i in range(3):
            G[:, i, i * count : (i + 1) * count] = own
        self.y = readings.outputs[test].ravel()
        self.variance = readings.sd[test].ravel() ** 2
        self._blend = np.zeros((len(rows.dwell), 3))
        self._blend[np.arange(3 * tests), np.tile(np.arange(3), tests)] = 1.0
        self._force = readings.force[rows.dwell]
        self._G = G.reshape(3 * tests, -1)
        self._add_checks(theta, basis)
        used = self.checks_used
        if unused is not None and unused.any():
            out = unused[rows.dwell, rows.output] & (rows.output >= 0)
            used = used & ~out
        self.used = used
        self.y = np.where(used, self.y - self._G @ MEAN.ravel(), 0.0)
        self.variance = np.where(used, self.variance, WIDE)
        level = np.abs(self._force[np.arange(len(used)), rows.output]) < 0.5
        self._level = level & (rows.output >= 0) & used
        self._G[~used] = 0.0
        self._more()

    def _add_checks(self, theta: FloatArray | None, basis: FloatArray) -> None:
        readings, test = self.readings, self.readings.test
        count = int((~test).sum())
        tests = len(self.y)
        self.checks_used = np.ones(tests + count, dtype=np.bool_)
        if not count:
            return
        J = np.zeros((count, self._G.shape[1]))
        z, variance = np.zeros(count), np.full(count, WIDE)
        if theta is None:
            self.checks_used[tests:] = False
        else:
            at = constants(theta, readings.temps_degc[~test], readings.t0_degc)
            seen = seen_force(readings, theta)[~test]
            length = np.linalg.norm(seen, axis=1)
            m = np.linalg.solve(
                np.swapaxes(at[:, :, 1:], 1, 2), (seen / length[:, None])[:, :, None]
            )[:, :, 0]
            one = np.column_stack([np.ones(count), seen])
            J = np.einsum("ni,nc,np->nicp", m, one, basis[~test]).reshape(count, -1)
            z = length - 1.0 + J @ theta
            variance = ((m * readings.sd[~test]) ** 2).sum(axis=1)
            self._blend[tests:] = m
            self._force = np.concatenate([self._force[:tests], seen])
        self._G = np.vstack([self._G, J])
        self.y = np.concatenate([self.y, z])
        self.variance = np.concatenate([self.variance, variance])

    def _more(self) -> None:
        """Columns of squares, seats and bends."""
        n, rows = len(self.y), self.rows
        self._square = self._blend * self._force**2
        seats = np.zeros((n, len(POSITIONS), 3))
        place = [POSITIONS.index(p) if p in POSITIONS else 0 for p in self.readings.positions]
        level = np.flatnonzero(self._level)
        seats[level, np.array(place, dtype=int)[rows.dwell[level]], rows.output[level]] = 1.0
        flat = seats.reshape(n, -1)
        self._seat = flat[:, flat.any(axis=0)]
        self._square = self._square * self.used[:, None]

    @cached_property
    def _bend(self) -> FloatArray:
        """Columns of what no polynomial follows, in the biases and half as much in the gains."""
        temps = self.readings.temps_degc
        features = BendFeatures(temps).at(temps)[self.rows.dwell]
        per_output = self._blend[:, :, None] * features[:, None, :]
        gains = per_output * self._force[:, :, None]
        n = len(self.y)
        bend = np.concatenate([per_output.reshape(n, -1), 0.5 * gains.reshape(n, -1)], axis=1)
        return np.asarray(bend * self.used[:, None])

    @cached_property
    def _straight(self) -> FloatArray:
        return np.concatenate([self._G, self._square, self._seat], axis=1)

    @cached_property
    def _bending(self) -> FloatArray:
        return np.concatenate([self._straight, self._bend], axis=1)

    def columns(self, scales: Scales) -> tuple[FloatArray, FloatArray]:
        """Columns of all parameters of a sound unit, and their prior standard deviations."""
        sds = [
            prior_sd(scales),
            np.full(3, SQUARE_SD),
            np.full(self._seat.shape[1], scales.seat),
        ]
        if scales.bend > 0:
            sds.append(np.full(self._bend.shape[1], scales.bend))
        return self._bending if scales.bend > 0 else self._straight, np.concatenate(sds)

    def row_variance(self, scales: Scales) -> FloatArray:
        """Of each row, shape (n,), g^2."""
        variance = self.variance * np.where(self.used, scales.noise**2, 1.0)
        return np.asarray(variance + np.where(self._level, scales.tilt**2, 0.0))

    def fit(self, scales: Scales, added: Added | None = None) -> Fit:
        """Most probable constants and amplitudes, and the evidence."""
        G, sd = self.columns(scales)
        y, k = self.y, 0
        if added is not None:
            extra = added.columns * self.used[:, None]
            k = extra.shape[1]
            G = np.concatenate([G, extra], axis=1)
            sd = np.concatenate([sd, np.full(k, added.size)])
            y = y + extra @ added.about
        root = 1.0 / np.sqrt(self.row_variance(scales))
        # The last row of the root of [[A, b], [b', y'y]] is L^-1 b, and then what is not explained.
        p = G.shape[1]
        whole = np.empty((len(y), p + 1))
        Gs, ys = whole[:, :p], whole[:, p]
        np.multiply(G, root[:, None], out=Gs)
        Gs *= sd
        np.multiply(root, y, out=ys)
        A = whole.T @ whole
        A.flat[: p * (p + 2) : p + 2] += 1.0
        floor = ROUNDING * (1.0 + A[p, p])
        A[p, p] += floor
        L: FloatArray = np.linalg.cholesky(A).astype(np.float64, copy=False)
        squares = float(L[p, p] ** 2 - floor)
        evidence = (
            -0.5 * squares
            + np.log(root).sum()
            - np.log(np.diag(L)[:p]).sum()
            - 0.5 * len(y) * np.log(2.0 * np.pi)
        )
        return Fit(float(evidence) + log_prior(scales), squares, k, Gs, ys, L[:p, :p], L[p, :p], sd)
