"""Method "additive": the correction that P1 prints, added."""

from __future__ import annotations

from functools import partial

import numpy as np

from triaxcal.model.methods.correction import added
from triaxcal.model.methods.method import DIRECT, CompensationMethod
from triaxcal.model.types import FloatArray


def _correction(K0: FloatArray, dK: FloatArray, dU0: FloatArray) -> tuple[FloatArray, FloatArray]:
    """P1 (5), (6): factor of (U - U0) and the constant part of Delta_a."""
    scale = np.diag(K0)
    both = np.outer(scale, scale)
    N = -K0 / both
    np.fill_diagonal(N, 1 / scale)
    return -dK / both, -np.einsum("ij,...j->...i", N, dU0)


ENTRY = CompensationMethod(
    name="additive",
    label="additive",
    doc="The constants of T0, plus a correction that follows the temperature.",
    short_label="additive",
    colour="#c8553d",
    form=DIRECT,
    functions=partial(added, _correction),
    rank=30,
)
