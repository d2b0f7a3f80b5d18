"""Vectors as the C drivers of the checks read them."""

from __future__ import annotations

import numpy as np

from triaxcal.codegen.crosscheck import VectorSet
from triaxcal.codegen.forces import forces_of, rates_of
from triaxcal.fixedpoint.plan import Plan


def rows_of(plan: Plan, vectors: VectorSet) -> bytes:
    """Rows of eight int32: temperature code, raw codes, dT/dt, specific force.

    The rate is nil for a plan without that term, the force for an accelerometer.
    """
    count = len(vectors.temp)
    rate = np.zeros(count) if plan.rate is None else rates_of(plan.rate, vectors.temp)
    force = forces_of(vectors.temp, vectors.raw) if plan.shape.gyro else np.zeros((count, 3))
    return np.column_stack([vectors.temp, vectors.raw, rate, force]).astype(np.int32).tobytes()
