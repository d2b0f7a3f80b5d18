"""The full scale or the gain is another one than stated."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, unchanged
from triaxcal.model.positions import AXES

_FACTORS = (0.25, 0.5, 2.0, 4.0, 1e-3, 1e3)
_LARGEST = 20.0
"""Log odds that one output's sensitivity can give: a data sheet may be of another type."""


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    nominal = known.sensitivity_v_per_g
    if nominal is None:
        return
    sd = known.tolerance / 2.0  # the tolerance is a bound
    off = np.log(np.abs(known.readings.volts_per_g / nominal)) / sd
    for factor in _FACTORS:
        shifted = off - np.log(factor) / sd
        for outputs in ((0, 1, 2), (0,), (1,), (2,)):
            some = list(outputs)
            each = 0.5 * (off[some] ** 2 - shifted[some] ** 2)
            gained = float(np.minimum(each, _LARGEST).sum())
            if gained < 0.0:
                continue
            names = "all outputs" if len(some) == 3 else f"output {AXES[some[0]]}"
            yield Hypothesis(
                f"{names}, {factor:g} times the nominal sensitivity",
                unchanged,
                change=f"with a full scale {1 / factor:g} times the stated one",
                places=4.0 * len(_FACTORS),
                log_prior=gained,
            )


ENTRY = Cause(
    name="gain",
    label="gain or full scale",
    doc="The sensitivity is a power of two or a thousand times the nominal one.",
    hypotheses=_hypotheses,
    apart="the settings of the converter",
    discrete=True,
    rank=37,
)
