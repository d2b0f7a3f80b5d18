"""What is known of the terms of each output beyond the straight line, from wherever it is known.

    E_i = K1_i (K0_i + a_i + K2_i a_i^2 + Koq_i a_i |a_i| + K3_i a_i^3 + K_jk a_j a_k + ...)

The fits have the inverse, a = l + Q p(l): to first order K2 = -Q_ii and K_jk = -Q_jk.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from triaxcal.fitting.core.calibration import Calibration
from triaxcal.model.positions import AXES
from triaxcal.model.terms import PRODUCT_NAMES
from triaxcal.model.types import FloatArray
from triaxcal.unit.reporting import Nonlinearity

_MICRO = 1e-6
ALL = 0.995
"""Share of the readings from which on no prior is named."""
SQUARES_DOF = 3.0
"""Of own squares from six positions: three values tell how far squareness and noise reach."""


@dataclass(frozen=True)
class Term:
    """One kind of term of the three outputs.

    Attributes
    ----------
    value, sd : arrays, shape (3,); of products of two axes (3, 6)
        g/g^2, or g/g^3 of a cube; `sd` is NaN where nothing is known.
    dof : float
        Degrees of freedom of `sd`.
    share : array of their shape
        How much of each was measured, 0 to 1; the rest is the prior.
    how : str
    """

    value: FloatArray
    sd: FloatArray
    dof: float
    share: FloatArray
    how: str

    def measured(self, share: float) -> str:
        """How a value was measured of which this share was."""
        if share >= ALL:
            return self.how
        return f"{self.how}; the readings determine {100.0 * share:.0f} %, the rest is the prior"


@dataclass(frozen=True)
class Nonlinear:
    """Terms beyond the straight line; None where they are not measured.

    Attributes
    ----------
    own_square, odd_square, cube : Term or None
    products : Term or None
        K_jk of each output in the order of `PRODUCT_NAMES`, own squares among them.
    in_c : array, shape (3, 6)
        Q of the C.
    """

    own_square: Term | None
    odd_square: Term | None
    cube: Term | None
    products: Term | None
    in_c: FloatArray


def nonlinear(calibration: Calibration, stated: Nonlinearity | None) -> Nonlinear:
    """Terms of a calibration; what [nonlinearity] states comes before what the fit shows."""
    Q = calibration.terms.quadratic_per_g
    products = _products(calibration)
    return Nonlinear(
        _stated(stated, "own_square") or _own_of_fit(calibration, products),
        _stated(stated, "odd_square"),
        _stated(stated, "cube"),
        products,
        np.zeros((3, 6)) if Q is None else Q,
    )


def _stated(stated: Nonlinearity | None, name: str) -> Term | None:
    values = None if stated is None else getattr(stated, name)
    if stated is None or values is None:
        return None
    sd = np.array(getattr(stated, f"{name}_sd"))
    return Term(np.array(values) * _MICRO, sd * _MICRO, math.inf, np.ones(3), stated.how)


def _own_of_fit(calibration: Calibration, products: Term | None) -> Term | None:
    squares = calibration.squares
    if squares is not None:
        spread, share = np.full(3, squares.sd_per_g), np.full(3, squares.data_share)
        how = "half-sums over opposite positions"
        return Term(-squares.per_g, spread, SQUARES_DOF, share, how)
    if products is None or np.isnan(products.sd[:, :3].diagonal()).any():
        return None
    parts = (p[:, :3].diagonal() for p in (products.value, products.sd, products.share))
    value, sd, share = parts
    return Term(value, sd, products.dof, share, products.how)


def _products(calibration: Calibration) -> Term | None:
    values, sd, share = np.zeros((3, 6)), np.full((3, 6), np.nan), np.zeros((3, 6))
    if calibration.pair is not None:
        pair = calibration.pair
        spread = np.sqrt(np.diag(pair.covariance)).reshape(3, 6)
        known = spread > 0.0
        values[known], sd[known], share[known] = -pair.quadratic[known], spread[known], 1.0
        return Term(values, sd, float(pair.dof), share, "an orthogonal pair on a dividing head")
    recording = calibration.recording
    found = {} if recording is None else {s.name: s for s in recording.shares}
    for i, axis in enumerate(AXES):
        for k, name in enumerate(PRODUCT_NAMES):
            one = found.get(f"Q{axis}.{name}")
            if one is not None:
                values[i, k], sd[i, k], share[i, k] = -one.value, one.sd, one.data
    if recording is None or np.isnan(sd).all():
        return None
    dof = max(float(recording.dof), 1.0)
    return Term(values, sd, dof, share, "the fit of the poses")
