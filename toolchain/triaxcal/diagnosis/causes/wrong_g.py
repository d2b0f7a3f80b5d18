"""The stated local gravity is not that of the place."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, unchanged

_LARGEST = 0.006
"""Relative: gravity on the ground differs by no more."""
_LARGEST_GAIN = 40.0


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    nominal = known.sensitivity_v_per_g
    if nominal is None:
        return
    off = np.log(np.abs(known.readings.volts_per_g / nominal))
    mean = float(off.mean())
    if abs(mean) > _LARGEST:
        return
    gained = 1.5 * (mean / known.tolerance) ** 2
    yield Hypothesis(
        f"{mean:+.2%}",
        unchanged,
        change=f"with a local gravity {mean:+.2%} of the stated one",
        log_prior=min(gained, _LARGEST_GAIN),
    )


ENTRY = Cause(
    name="wrong_g",
    label="another local gravity",
    doc="All sensitivities differ from their nominal ones alike, by what gravity can differ.",
    hypotheses=_hypotheses,
    apart="latitude and height of the place",
    discrete=True,
    rank=38,
)
