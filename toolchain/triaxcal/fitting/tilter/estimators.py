"""The twelve constants from six positions: three estimators as explicit linear operators.

In position d output i reads U_id = sum_j K_ij a_jd + U0_i, P1 (9): per output a row of a (6, 4)
design matrix A times (K_ix, K_iy, K_iz, U0_i). Every estimator here is a (4, 6) matrix E with
E A = 1, so constants = E U, and their covariance is E diag(var U) E^T. Outputs do not mix.

equation-10    P1 (10): K by half-differences; U0_i the mean over the four positions that leave
               output i's own axis level.
least-squares  all six positions, weighted by the dwells' variances where these are recorded.
half-sum       K as above; U0_i the half-sum over the two positions of output i's own axis.
"""

from __future__ import annotations

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.metrological import pack_blocks, unpack_constants
from triaxcal.model.positions import AXES, TEST_POSITIONS
from triaxcal.model.types import FloatArray

CONDITION_MAX = 100.0
"""Two outputs within about a degree of each other have K, rows scaled to 1, conditioned so."""
DEAD_OUTPUT = 1e-3
"""An output that follows gravity less than this times the liveliest one is dead: noise."""

_FORCES = np.array(list(TEST_POSITIONS.values()), dtype=np.float64)


def design_matrix(gravity_g: float) -> FloatArray:
    """A of P1 (9), shape (6, 4): force in TP1..TP6 (g) and 1 for the bias."""
    return np.column_stack([_FORCES * gravity_g, np.ones(6)])


def estimator_operators(
    estimator: str, gravity_g: float, variance_v2: FloatArray | None, groups: int
) -> FloatArray:
    """E of an estimator, shape (G, 3, 4, 6): constants (K_ix, K_iy, K_iz, U0_i) = E U_i.

    Parameters
    ----------
    estimator : str
        One of `unit.choices.ESTIMATORS`.
    variance_v2 : array, shape (G, 6, 3), or None
        Weights of least squares; None weights all positions alike.
    """
    if estimator == "least-squares" and variance_v2 is not None:
        return _weighted_least_squares(design_matrix(gravity_g), variance_v2)
    own = _FORCES.T != 0.0
    # With equal weights the columns of A are orthogonal: K is P1 (10), U0 the mean of all six.
    bias = {"equation-10": ~own / 4.0, "least-squares": np.full((3, 6), 1 / 6), "half-sum": own / 2}
    operator = np.zeros((3, 4, 6))
    operator[:, :3] = _FORCES.T / (2.0 * gravity_g)
    operator[:, 3] = bias[estimator]
    return np.broadcast_to(operator, (groups, 3, 4, 6)).copy()


def constants_of(operators: FloatArray, voltage_v: FloatArray) -> FloatArray:
    """Constants, shape (..., G, 12), of operators (..., G, 3, 4, 6) and readings (G, 6, 3)."""
    by_output = np.swapaxes(voltage_v, -1, -2)[..., None]
    return pack_rows((operators @ by_output)[..., 0])


def constants_covariance(operators: FloatArray, variance_v2: FloatArray) -> FloatArray:
    """Covariance, shape (G, 12, 12), for operators (G, 3, 4, 6) and variances (G, 6, 3)."""
    by_output = np.swapaxes(variance_v2, -1, -2)[..., None, :]
    return pack_blocks((operators * by_output) @ np.swapaxes(operators, -1, -2))


def pack_rows(rows: FloatArray) -> FloatArray:
    """(..., 3, 4), per output K row and U0, in the order of `CONSTANT_NAMES`, (..., 12)."""
    K = rows[..., :3].reshape(*rows.shape[:-2], 9)
    return np.concatenate([K, rows[..., 3]], axis=-1)


def pooled_variance(voltage_v: FloatArray) -> FloatArray:
    """Variance of a reading of each output, shape (3,), from all groups' residuals.

    Six readings and four constants leave two degrees of freedom an output and temperature. They
    are the two differences between the three half-sums over opposite positions, each of which
    estimates U0_i: any scatter among them is noise or imperfect placement.

    Parameters
    ----------
    voltage_v : array, shape (G, 6, 3)
        Readings brought to one temperature in each group.
    """
    design = design_matrix(1.0)
    projector = np.eye(6) - design @ np.linalg.pinv(design)
    residual = projector @ voltage_v
    variance: FloatArray = np.sum(residual**2, axis=(0, 1)) / (2.0 * voltage_v.shape[0])
    return variance


def position_residuals_g(design: FloatArray, voltage_v: FloatArray) -> FloatArray:
    """Residuals (G, 6, 3) of each temperature's own constants, by the output's scale factor, in g.

    Six positions leave two degrees of freedom to each output and temperature.
    """
    constants = np.linalg.pinv(design) @ voltage_v
    scale = np.abs(constants[:, range(3), range(3)])[:, None]
    result: FloatArray = (voltage_v - design @ constants) / scale
    return result


def refuse_ill_conditioned(where: str, temp_degc: float, constants: FloatArray) -> None:
    """Refuse a K that cannot be inverted, and say which outputs look alike.

    Rows are scaled to length 1 first: outputs of different sensitivity are no fault.

    Raises
    ------
    RefusedError
        When an output does not respond to gravity, or cond(K) > `CONDITION_MAX`.
    """
    K, _ = unpack_constants(constants)
    length = np.linalg.norm(K, axis=1)
    at = f"at {temp_degc:.6g} degC"
    dead = length <= DEAD_OUTPUT * length.max()
    if length.max() == 0.0 or dead.any():
        names = ", ".join(f"U{AXES[i]}" for i in range(3) if dead[i])
        raise RefusedError(
            where,
            f"{names} does not respond to gravity {at}",
            expected="an output that changes from position to position",
            remedy="check the wiring and the columns of the readings",
        )
    rows = K / length[:, None]
    condition = float(np.linalg.cond(rows))
    if condition <= CONDITION_MAX:
        return
    cosine = np.abs(rows @ rows.T) - np.eye(3)
    i, j = np.unravel_index(np.argmax(cosine), cosine.shape)
    alike = f"outputs U{AXES[i]} and U{AXES[j]} respond alike"
    if cosine[i, j] < 0.99:
        alike = "the three sensing axes lie in one plane"
    raise RefusedError(
        where,
        f"K {at} has condition number {condition:.3g}: {alike}",
        expected=f"at most {CONDITION_MAX:g}",
        remedy="check the wiring, the columns and the positions",
    )


def _weighted_least_squares(design: FloatArray, variance_v2: FloatArray) -> FloatArray:
    weights = 1.0 / np.swapaxes(variance_v2, -1, -2)[..., None, :]
    weighted = design.T * (weights / weights.max(axis=-1, keepdims=True))
    # Condition number of the normal matrix: 3 times the spread of the weights, no more.
    solution: FloatArray = np.linalg.solve(weighted @ design, weighted)
    return solution
