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

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from triaxcal.diagnosis.core.readings import POSITIONS, Readings
from triaxcal.model.types import BoolArray, FloatArray, IntArray

ORDERS = 5
"""Coefficients of a curve over (T - T0) / 50 degC."""
_SPAN_DEGC = 50.0
_BEND_DEGC = 10.0
"""Correlation length of what bends faster than the polynomials."""
_SQUARE_SD = 1e-4
"""Of an own-axis square that nobody would notice, g/g^2."""
_WIDE = 1.0
"""Variance, g^2, of a row that the model does not use."""


@dataclass(frozen=True)
class Scales:
    """Standard deviations of the priors; the data choose them within priors of their own.

    Attributes
    ----------
    noise : float
        Of the readings, as a multiple of what is stated.
    tilt : float
        Of one placement, rad.
    seat : float
        Of a position at all temperatures (squareness and reproducible errors of the rig), rad.
    curvature : float
        Of the curves, as a multiple of that of a usual sensor.
    bend : float
        Of what no polynomial follows, g.
    """

    noise: float = 1.0
    tilt: float = 30e-6
    seat: float = 100e-6
    curvature: float = 1.0
    bend: float = 0.0


_CHOICES: dict[str, tuple[tuple[float, ...], float, float]] = {
    "noise": ((0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8), 1.0, 0.5),
    "tilt": ((4e-6, 10e-6, 20e-6, 40e-6, 80e-6, 160e-6), 30e-6, 0.8),
    "seat": ((15e-6, 40e-6, 80e-6, 160e-6, 240e-6), 80e-6, 0.6),
    "curvature": ((0.1, 0.3, 1.0, 3.0, 10.0, 30.0), 1.5, 1.5),
    "bend": ((0.0, 50e-6, 100e-6, 200e-6), 70e-6, 0.8),
}
"""Values of each scale, and mean and standard deviation of its logarithm."""


def _log_prior(scales: Scales) -> float:
    total = 0.0
    for name, (choices, middle, spread) in _CHOICES.items():
        if not choices[0] <= getattr(scales, name) <= choices[-1]:
            continue  # of a cause that is about this scale, and pays for it itself
        value = max(getattr(scales, name), 20e-6 if name == "bend" else 0.0)
        total -= 0.5 * (np.log(value / middle) / spread) ** 2
    return float(total)


def _prior_sd() -> tuple[FloatArray, FloatArray]:
    """Of the constants, shape (3, 4, ORDERS): fixed, and to be multiplied by `curvature`."""
    fixed, curved = np.zeros((3, 4, ORDERS)), np.zeros((3, 4, ORDERS))
    for i in range(3):
        fixed[i, 0, :2] = 0.5, 0.03
        curved[i, 0, 2:] = 1e-3, 4e-4, 1.5e-4
        for j in range(3):
            own = i == j
            fixed[i, 1 + j, :2] = (0.05, 0.02) if own else (0.03, 1e-3)
            curved[i, 1 + j, 2:] = (5e-4, 2e-4, 7e-5) if own else (1e-4, 4e-5, 1.5e-5)
    return fixed.ravel(), curved.ravel()


_FIXED, _CURVED = _prior_sd()
MEAN = np.zeros((3, 4, ORDERS))
"""Prior mean of the constants: outputs are in g."""
MEAN[(0, 1, 2), (1, 2, 3), 0] = 1.0


def powers(temps_degc: FloatArray, t0_degc: float) -> FloatArray:
    """Functions of temperature, shape (n, ORDERS)."""
    x = (np.asarray(temps_degc, dtype=np.float64) - t0_degc) / _SPAN_DEGC
    return np.asarray(x[:, None] ** np.arange(ORDERS))


def constants(theta: FloatArray, temps_degc: FloatArray, t0_degc: float) -> FloatArray:
    """U0 and K at temperatures, shape (n, 3, 4): column 0 is U0."""
    curves = theta.reshape(3, 4, ORDERS)
    return np.asarray(np.einsum("icp,np->nic", curves, powers(temps_degc, t0_degc)))


def seen_force(readings: Readings, theta: FloatArray) -> FloatArray:
    """Force that the unit sees with these constants, shape (n, 3), g."""
    at = constants(theta, readings.temps_degc, readings.t0_degc)
    free = (readings.outputs - at[:, :, 0])[:, :, None]
    return np.asarray(np.linalg.solve(at[:, :, 1:], free)[:, :, 0])


def residuals(readings: Readings, theta: FloatArray) -> FloatArray:
    """Of every row: output less model in test positions, |a| - g in check positions, g."""
    test = readings.test
    at = constants(theta, readings.temps_degc, readings.t0_degc)
    model = at[:, :, 0] + np.einsum("nij,nj->ni", at[:, :, 1:], readings.force)
    own = (readings.outputs - model)[test].ravel()
    if test.all():
        return np.asarray(own)
    seen = np.linalg.norm(seen_force(readings, theta)[~test], axis=1) - 1.0
    return np.concatenate([own, seen])


class BendFeatures:
    """Functions of temperature with the covariance exp(-(dT / length)^2 / 2) at given ones."""

    def __init__(self, temps_degc: FloatArray, length_degc: float = _BEND_DEGC) -> None:
        self.temps = np.unique(np.round(temps_degc, 1))
        self.length = length_degc
        values, vectors = np.linalg.eigh(self._kernel(self.temps))
        keep = values > 1e-3
        self._map = vectors[:, keep] / np.sqrt(values[keep])
        self.count = int(keep.sum())

    def _kernel(self, temps_degc: FloatArray) -> FloatArray:
        return np.asarray(np.exp(-0.5 * ((temps_degc[:, None] - self.temps) / self.length) ** 2))

    def at(self, temps_degc: FloatArray) -> FloatArray:
        """Shape (n, count)."""
        return np.asarray(self._kernel(temps_degc) @ self._map)


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
    size : float
        Prior standard deviation of the amplitudes, mean zero.
    about : array, shape (k,)
        Amplitudes that have been taken off the readings already.
    """

    columns: FloatArray
    size: float
    about: FloatArray


@dataclass(frozen=True)
class Fit:
    """Constants and amplitudes that are most probable, and how probable the readings are.

    Attributes
    ----------
    log_evidence : float
    values : array
        Of all parameters, less their prior means; the last `added` are amplitudes.
    added : int
    residual : array, shape (n,)
        Of the rows in their standard deviations.
    root, scale : arrays
        Cholesky root of the inverse covariance of the parameters, which are divided by `scale`.
    """

    log_evidence: float
    values: FloatArray
    added: int
    residual: FloatArray
    root: FloatArray
    scale: FloatArray

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
        self.readings, self.linear_about = readings, theta
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
        self.variance = np.where(used, self.variance, _WIDE)
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
        z, variance = np.zeros(count), np.full(count, _WIDE)
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

    def columns(self, scales: Scales) -> tuple[FloatArray, FloatArray]:
        """Columns of all parameters of a sound unit, and their prior standard deviations."""
        parts = [self._G, self._square, self._seat]
        sds = [
            np.sqrt(_FIXED**2 + (scales.curvature * _CURVED) ** 2),
            np.full(3, _SQUARE_SD),
            np.full(self._seat.shape[1], scales.seat),
        ]
        if scales.bend > 0:
            parts.append(self._bend)
            sds.append(np.full(self._bend.shape[1], scales.bend))
        return np.concatenate(parts, axis=1), np.concatenate(sds)

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
        Gs, ys = (root[:, None] * G) * sd, root * y
        A = Gs.T @ Gs
        A.flat[:: len(A) + 1] += 1.0
        L: FloatArray = np.linalg.cholesky(A).astype(np.float64)
        u = np.linalg.solve(A, Gs.T @ ys)
        rest = ys - Gs @ u
        evidence = (
            -0.5 * (rest @ rest + u @ u)
            + np.log(root).sum()
            - np.log(np.diag(L)).sum()
            - 0.5 * len(y) * np.log(2.0 * np.pi)
        )
        return Fit(float(evidence) + _log_prior(scales), u * sd, k, rest, L, sd)


def nearby(scales: Scales, name: str) -> list[Scales]:
    """The same with the next values of one scale."""
    values = _CHOICES[name][0]
    value = getattr(scales, name)
    at = int(np.argmin([abs(v - value) for v in values]))
    ks = [k for k in (at - 1, at + 1) if 0 <= k < len(values)]
    return [replace(scales, **{name: values[k]}) for k in ks]


SCALE_NAMES = tuple(f.name for f in fields(Scales))
