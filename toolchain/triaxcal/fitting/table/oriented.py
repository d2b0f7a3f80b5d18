"""Known orientations, P0: calibration functions of a triad from the angles of a table.

inverse   g = c0 + C U (12), and with products of the linear result (13)
forward   U = d0 + D g (28), and with products of g (29), solved for g by (36), (37)

The forward design depends on the table's angles alone, so its inverse is computed once for a whole
series of units (`SerialGrid`). On |g| = const the squares sum to a constant: of the ten functions
of (13), (22) and (29), nine are independent, and the ten by ten matrix of the paper is singular.
The squares are therefore taken without their sum (`TRACELESS`), five functions for six products.

Everything is solved by QR of the design, which needs no (17) nor (20); those are in
`normal_equations`, as what the tests compare with.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from triaxcal.model.orientation import angle_slopes, gravity_direction
from triaxcal.model.terms import products
from triaxcal.model.types import FloatArray

TRACELESS = np.array(
    [
        [1.0, 0.0, -1.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, -1.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
    ]
)
"""Five functions xx - zz, yy - zz, xy, xz, yz by the products of `model.terms`."""


_ROUNDS = 6


@dataclass(frozen=True)
class OrientedFit:
    """Constants from known orientations.

    Attributes
    ----------
    K, U0 : arrays, shapes (3, 3) and (3,)
        Of P1 (1): U = K l + U0.
    quadratic : array, shape (3, 6), or None
        Q of a = l + Q p(l).
    condition : float
        Of the design, its columns scaled to length 1.
    """

    K: FloatArray
    U0: FloatArray
    quadratic: FloatArray | None
    condition: float

    def force_g(self, readings: FloatArray) -> FloatArray:
        """Specific force, shape (n, 3), of readings (n, 3)."""
        linear: FloatArray = np.linalg.solve(self.K, (readings - self.U0).T).T.astype(np.float64)
        if self.quadratic is None:
            return linear
        result: FloatArray = linear + products(linear) @ self.quadratic.T
        return result


def inverse_linear(readings: FloatArray, force: FloatArray) -> OrientedFit:
    """P0 (12), (14): g = c0 + C U, as K = C^-1 and U0 = -K c0."""
    middle, spread = readings.mean(axis=0), float(readings.std()) or 1.0
    design = _with_one((readings - middle) / spread)
    solution = _solve(design, force)
    C = solution[1:].T / spread
    K = np.linalg.inv(C).astype(np.float64)
    return OrientedFit(K, middle - K @ solution[0], None, scaled_condition(design))


def inverse_two_stage(
    readings: FloatArray, force: FloatArray, *, as_printed: bool = False
) -> OrientedFit:
    """P0 (25): the linear function first, then the products on what it leaves.

    As printed the products are fitted to those residuals as they are. But what they have in common
    with the linear functions is no longer in the residuals, so too little of Q is found. Freed of
    that part first (Frisch and Waugh), the products give the Q of the solution at once, and the
    linear part follows; each round as in `inverse_quadratic`.
    """
    if as_printed:
        fit = inverse_linear(readings, force)
        linear = fit.force_g(readings)
        design = products(linear) @ TRACELESS.T
        Q = _solve(design, force - linear).T @ TRACELESS
        return OrientedFit(fit.K, fit.U0, Q, scaled_condition(design))
    return _rounds(readings, force, _in_two_stages)


def _in_two_stages(linear: FloatArray, bent: FloatArray, force: FloatArray) -> FloatArray:
    basis = np.linalg.qr(linear)[0]
    free = bent - basis @ (basis.T @ bent)
    quadratic = _solve(free, force - basis @ (basis.T @ force))
    return np.concatenate([_solve(linear, force - bent @ quadratic), quadratic])


def _at_once(linear: FloatArray, bent: FloatArray, force: FloatArray) -> FloatArray:
    return _solve(np.concatenate([linear, bent], axis=1), force)


def inverse_quadratic(readings: FloatArray, force: FloatArray) -> OrientedFit:
    """P0 (13), (22) in products of the linear result: all nine unknowns an axis at once.

    The condition number is that of the known forces: noise in a product that no position has would
    pass for the product.

    g = c0 + C l + Q p(l) is solved with l of (12); then C l + c0 is the next l, until it stays: the
    linear part of the answer is then l itself. Each round gains the size of Q.
    """
    return _rounds(readings, force, _at_once)


def _rounds(
    readings: FloatArray,
    force: FloatArray,
    solve: Callable[[FloatArray, FloatArray, FloatArray], FloatArray],
) -> OrientedFit:
    fit = inverse_linear(readings, force)
    K, U0, Q = fit.K, fit.U0, np.zeros((3, 6))
    for _ in range(_ROUNDS):
        linear = OrientedFit(K, U0, None, 1.0).force_g(readings)
        solution = solve(_with_one(linear), products(linear) @ TRACELESS.T, force)
        K = (K @ np.linalg.inv(solution[1:4].T)).astype(np.float64)
        U0 = U0 - K @ solution[0]
        Q = solution[4:].T @ TRACELESS
    return OrientedFit(K, U0, Q, SerialGrid.of(force, quadratic=True).condition)


@dataclass(frozen=True)
class SerialGrid:
    """A grid of known forces with its design inverted once, P0 (31), (35), for a series of units.

    Attributes
    ----------
    operator : array, shape (4 or 9, n)
        Readings to the unknowns of one output: d0, d1..d3, and the five of `TRACELESS`.
    condition : float
    """

    operator: FloatArray
    condition: float

    @staticmethod
    def of(force: FloatArray, *, quadratic: bool = False, centred: bool = False) -> SerialGrid:
        """Grid of forces (n, 3) in g; `centred` solves (33) to (35), one order less, with (32)."""
        bent = products(force) @ TRACELESS.T if quadratic else np.zeros((len(force), 0))
        functions = np.concatenate([force, bent], axis=1)
        condition = scaled_condition(_with_one(functions))
        if not centred:
            return SerialGrid(_inverse(_with_one(functions)), condition)
        middle = functions.mean(axis=0)
        part = _inverse(functions - middle)
        mean = np.full((1, len(force)), 1.0 / len(force))
        # (32): d0 = mean of the readings less the others at the middle of the functions.
        return SerialGrid(np.concatenate([mean - middle @ part, part]), condition)

    def unknowns(self, readings: FloatArray) -> FloatArray:
        """Unknowns, shape (3, 4 or 9), of readings (n, 3) taken on the grid."""
        result: FloatArray = (self.operator @ readings).T
        return result

    def fit(self, readings: FloatArray) -> OrientedFit:
        """P0 (28), or (29) solved as (36), (37) with the linear solution in the products.

        g = D^-1 (U - d0 - D2 p(g)), so with l = D^-1 (U - d0): a = l - D^-1 D2 p(l).
        """
        unknowns = self.unknowns(readings)
        d0, D = unknowns[:, 0], unknowns[:, 1:4]
        if unknowns.shape[1] == 4:
            return OrientedFit(D, d0, None, self.condition)
        D2 = unknowns[:, 4:] @ TRACELESS
        return OrientedFit(D, d0, -np.linalg.solve(D, D2), self.condition)


def table_error_g(
    kind: str, angles_rad: FloatArray, angle_sd_rad: float, level_sd_rad: float, gravity_g: float
) -> FloatArray:
    """Standard error of the reference force by the table, shape (n, 3), P0 end of section 5.

    Both angles, independent, through the derivatives of (6); and the table's plane out of level by
    `level_sd_rad` about each horizontal axis, which moves g_i by the sine of its angle to Z.
    """
    slopes = angle_slopes(kind, angles_rad)
    direction = gravity_direction(kind, angles_rad)
    angles = angle_sd_rad**2 * (slopes**2).sum(axis=-1)
    level = level_sd_rad**2 * (1.0 - direction**2)
    result: FloatArray = gravity_g * np.sqrt(angles + level)
    return result


def design_condition(force: FloatArray) -> float:
    """Condition number of the linear design of forces or directions (n, 3)."""
    return scaled_condition(_with_one(force))


def _with_one(values: FloatArray) -> FloatArray:
    return np.concatenate([np.ones((len(values), 1)), values], axis=1)


def _inverse(design: FloatArray) -> FloatArray:
    """(A^T A)^-1 A^T, by QR."""
    Q, R = np.linalg.qr(design)
    result: FloatArray = np.linalg.solve(R, Q.T).astype(np.float64)
    return result


def _solve(design: FloatArray, right: FloatArray) -> FloatArray:
    solution: FloatArray = np.linalg.lstsq(design, right, rcond=None)[0].astype(np.float64)
    return solution


def scaled_condition(design: FloatArray) -> float:
    """Condition number of a design, its columns scaled to length 1 as far as they are seen."""
    # A function that stays below 0.03 g is not brought to length 1: it is not seen.
    length = np.maximum(np.linalg.norm(design, axis=0), 0.03 * np.sqrt(len(design)))
    singular = np.linalg.svd(design / length, compute_uv=False)
    return float(singular[0] / singular[-1]) if singular[-1] > 0.0 else float("inf")
