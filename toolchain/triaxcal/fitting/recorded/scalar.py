"""The scalar model: only |a| = g is known of each pose.

The model is that of P1 (1), a = K(T)^-1 (U - U0(T)), with optional quadratic terms in products of
the linear result, a + Q p(a), p the six products of P0 (13)
(`model.terms`). Minimised is

    r_p = |a_p| - g,    weighted by the pose.

A rotation of a changes no |a|, so K is sought among the symmetric matrices: of all frames the one
that turns the outputs' own axes least. Six entries of K and three biases are the nine constants.
On a sphere |a + Q p(a)| changes by the cubic form a.Q p(a) / |a|; its parts of degree one act as a
bias, and only seven of the eighteen terms are left that |a| can see (`VISIBLE`).

Readings are scaled by a sphere through them before anything is solved, so that K is about 1 and a
singular value of the Jacobian means the same in counts and in m/s^2.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from triaxcal.model.terms import PRODUCT_AXES, product_slopes, products
from triaxcal.model.types import BoolArray, FloatArray

_RADIUS_MAX = 4.0
"""Of the poses' spread: a cap of 20 deg about one direction has 4.2, poses all round have 1."""
_NINE = (("Kxx", 0, 0), ("Kyy", 1, 1), ("Kzz", 2, 2), ("Kxy", 0, 1), ("Kxz", 0, 2), ("Kyz", 1, 2))


def _visible() -> FloatArray:
    """The seven directions of Q, (7, 3, 6), that change |a| on a sphere otherwise than a bias."""
    directions = np.random.default_rng(0).standard_normal((200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    effect = np.einsum("ni,nk->nik", directions, products(directions)).reshape(-1, 18)
    bias = np.linalg.qr(directions)[0]
    _, singular, vt = np.linalg.svd(effect - bias @ (bias.T @ effect))
    seen = vt[: int((singular > 1e-9 * singular[0]).sum())]
    result: FloatArray = seen.reshape(-1, 3, 6)
    return result


VISIBLE = _visible()


def _symmetric(i: int, j: int) -> FloatArray:
    matrix = np.zeros((3, 3))
    matrix[i, j] = matrix[j, i] = 1.0
    return matrix


def _square(i: int) -> FloatArray:
    matrix = np.zeros((3, 6))
    matrix[i, PRODUCT_AXES.index((i, i))] = 1.0
    return matrix


GROUPS = ("cross_term_rad", "scale_factor", "own_square_g_per_g2", "product_g_per_g2")
"""Keys of [priors] whose scales poses show."""


@dataclass(frozen=True)
class ScalarModel:
    """Which constants are free.

    Attributes
    ----------
    label : str
        Words for tables.
    gain_names : tuple of str
    gain : array, shape (m, 3, 3)
        K is the sum of these, each with its parameter.
    quadratic : array, shape (q, 3, 6)
        Q likewise.
    known : array, shape (3, 6)
        Part of Q that is known beforehand.
    """

    label: str
    gain_names: tuple[str, ...]
    gain: FloatArray
    quadratic: FloatArray
    known: FloatArray = field(default_factory=lambda: np.zeros((3, 6)))

    @property
    def parameters(self) -> int:
        """Free constants at one temperature."""
        return len(self.gain) + 3 + len(self.quadratic)

    @property
    def own_square(self) -> BoolArray:
        """Which of `quadratic` are the square of an axis' own acceleration, (q,)."""
        result: BoolArray = np.einsum("qij,ij->q", self.quadratic, SQUARES.sum(axis=0)) > 0.0
        return result

    @property
    def groups(self) -> tuple[str, ...]:
        """Those of `GROUPS` that have a constant here; with priors, K has all its entries."""
        own = self.own_square
        return GROUPS[:2] + GROUPS[2:3] * bool(own.any()) + GROUPS[3:] * bool((~own).any())


_NONE = np.zeros((0, 3, 6))
_GAINS = np.array([_symmetric(i, j) for _, i, j in _NINE])
_NAMES = tuple(name for name, _, _ in _NINE)
SQUARES = np.array([_square(i) for i in range(3)])
"""The square of each axis' own acceleration, (3, 3, 6)."""
NINE = ScalarModel("linear, nine constants", _NAMES, _GAINS, _NONE)
MODELS = (
    ScalarModel("bias and one scale factor", ("K",), np.eye(3)[None], _NONE),
    ScalarModel("bias and scale factors", _NAMES[:3], _GAINS[:3], _NONE),
    NINE,
    ScalarModel("nine constants and squares", _NAMES, _GAINS, SQUARES),
    ScalarModel("nine constants and all quadratic terms", _NAMES, _GAINS, VISIBLE),
)


@dataclass(frozen=True)
class ScalarData:
    """Poses, scaled.

    Attributes
    ----------
    reading : array, shape (n, 3)
        (U - centre) / radius.
    basis : array, shape (n, P)
        Functions of temperature at the poses.
    weight : array, shape (n,)
        Square roots of the weights, at most 1.
    count : array, shape (n,)
        For how many values a pose counts: less than one where several say one thing.
    gravity_g : float
    """

    reading: FloatArray
    basis: FloatArray
    weight: FloatArray
    gravity_g: float
    centre: FloatArray
    radius: float
    count: FloatArray = field(default_factory=lambda: np.zeros(0))

    def select(self, kept: BoolArray) -> ScalarData:
        """Only the poses of a mask."""
        return ScalarData(
            self.reading[kept],
            self.basis[kept],
            self.weight[kept],
            self.gravity_g,
            self.centre,
            self.radius,
            self.count[kept] if len(self.count) else self.count,
        )

    @property
    def values(self) -> float | None:
        """How many values there are, where `count` says it."""
        return float(self.count.sum()) if len(self.count) else None

    @property
    def quality(self) -> FloatArray:
        """Square roots of the weights by the poses' own scatter alone, (n,)."""
        return self.weight / np.sqrt(self.count) if len(self.count) else self.weight

    def with_basis(self, basis: FloatArray) -> ScalarData:
        """The same poses with other functions of temperature."""
        return replace(self, basis=basis)


def scalar_data(
    readings: FloatArray, basis: FloatArray, weight: FloatArray, gravity_g: float
) -> ScalarData:
    """Scale readings, shape (n, 3), by the sphere through them, a linear least-squares problem."""
    middle = readings.mean(axis=0)
    spread = float(np.sqrt(((readings - middle) ** 2).sum(axis=1).mean())) or 1.0
    v = (readings - middle) / spread
    # |v|^2 = 2 c.v + (r^2 - |c|^2); the minimum-norm solution where poses lie in a plane.
    design = np.concatenate([2.0 * v, np.ones((len(v), 1))], axis=1)
    for cut in (1e-6, 0.1):
        solution = np.linalg.lstsq(design, (v**2).sum(axis=1), rcond=cut)[0]
        radius = float(np.sqrt(max(solution[3] + (solution[:3] ** 2).sum(), 1e-12)))
        # Near a plane noise alone says where the centre is along its normal: far off.
        if radius < _RADIUS_MAX:
            break
    centre = middle + spread * solution[:3]
    return ScalarData(
        reading=(readings - centre) / (spread * radius),
        basis=basis,
        weight=weight,
        gravity_g=gravity_g,
        centre=centre,
        radius=spread * radius,
    )


def unscaled_data(
    readings: FloatArray, basis: FloatArray, weight: FloatArray, gravity_g: float
) -> ScalarData:
    """The same about 0, by the readings' own length: for poses that determine no sphere."""
    radius = float(np.median(np.linalg.norm(readings, axis=1)))
    return ScalarData(readings / radius, basis, weight, gravity_g, np.zeros(3), radius)


def constant_part(basis: FloatArray) -> FloatArray:
    """Weights (P,) with which functions of temperature at the poses, (n, P), sum to 1."""
    weights = np.linalg.lstsq(basis, np.ones(len(basis)), rcond=None)[0]
    return np.asarray(weights, dtype=np.float64)


def split(
    model: ScalarModel, gain_functions: int, P: int, theta: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """K (P, 3, 3) and bias (P, 3) by function of temperature, and Q (3, 6), from theta."""
    m = len(model.gain)
    gains = np.zeros((m, P))
    gains[:, :gain_functions] = theta[: m * gain_functions].reshape(m, gain_functions)
    rest = theta[m * gain_functions :]
    bias = rest[: 3 * P].reshape(3, P).T
    K = np.einsum("mp,mij->pij", gains, model.gain)
    Q = model.known + np.einsum("q,qij->ij", rest[3 * P :], model.quadratic)
    return K, bias, Q


def residual_of(
    model: ScalarModel, gain_functions: int, data: ScalarData, theta: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """|a| - g (n,) and its derivatives (n, parameters)."""
    n, P = data.basis.shape
    K_p, bias_p, Q = split(model, gain_functions, P, theta)
    if P == 1:  # one temperature: one matrix
        N = np.linalg.inv(K_p[0]) / data.basis[:, :, None]
    else:
        N = np.linalg.inv(np.einsum("np,pij->nij", data.basis, K_p))
    linear = (N @ (data.reading - data.basis @ bias_p)[:, :, None])[:, :, 0]
    force = linear + products(linear) @ Q.T
    length = np.linalg.norm(force, axis=1)
    unit = force / length[:, None]
    through = np.broadcast_to(np.eye(3), (n, 3, 3))
    if Q.any():
        through = through + Q @ product_slopes(linear)
    row = ((unit[:, None] @ through) @ N)[:, 0]  # d|a| / d(U - U0)
    outer = (row[:, :, None] * linear[:, None, :]).reshape(n, 9)
    by_gain = -outer @ model.gain.reshape(-1, 9).T
    by_product = (unit[:, :, None] * products(linear)[:, None, :]).reshape(n, 18)
    columns = [
        (by_gain[:, :, None] * data.basis[:, None, :gain_functions]).reshape(n, -1),
        (-row[:, :, None] * data.basis[:, None, :]).reshape(n, -1),
        by_product @ model.quadratic.reshape(-1, 18).T,
    ]
    return length - data.gravity_g, np.concatenate(columns, axis=1)
