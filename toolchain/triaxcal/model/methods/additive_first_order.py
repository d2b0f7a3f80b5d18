"""Method "additive-first-order": the whole first order of P1 (1)."""

from __future__ import annotations

from functools import partial

import numpy as np

from triaxcal.model.methods.correction import added
from triaxcal.model.methods.method import DIRECT, CompensationMethod
from triaxcal.model.types import FloatArray


def _correction(K0: FloatArray, dK: FloatArray, dU0: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Full first order of P1 (1): -(N dK N (U - U0) + N dU0), with the exact N = K0^-1."""
    N = np.linalg.inv(K0)
    factor: FloatArray = -(N @ dK @ N)
    return factor, -np.einsum("ij,...j->...i", N, dU0)


ENTRY = CompensationMethod(
    name="additive-first-order",
    label="additive-first-order",
    doc="The constants of T0, plus the whole first order in the changes of K and U0.",
    short_label="add.-first-order",
    colour="#7b4ea3",
    form=DIRECT,
    functions=partial(added, _correction),
    rank=50,
)
