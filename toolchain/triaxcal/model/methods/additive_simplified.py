"""Method "additive-simplified": the short form of the correction of P1."""

from __future__ import annotations

from functools import partial

import numpy as np

from triaxcal.model.methods.correction import added
from triaxcal.model.methods.method import DIRECT, CompensationMethod
from triaxcal.model.types import FloatArray


def _correction(K0: FloatArray, dK: FloatArray, dU0: FloatArray) -> tuple[FloatArray, FloatArray]:
    """P1 (7), (8): the first and third terms of (5), (6) only."""
    scale = np.diag(K0)
    return -dK * np.eye(3) / scale**2, -dU0 / scale


ENTRY = CompensationMethod(
    name="additive-simplified",
    label="additive-simplified",
    doc="The constants of T0, plus the diagonal part of that correction.",
    short_label="add.-simplified",
    colour="#e9a23b",
    form=DIRECT,
    functions=partial(added, _correction),
    rank=40,
)
