"""What a standard deviation comes from: parts of its variance, by source.

The covariance of a linear estimate is homogeneous: all variances of noise and prior times c make it
c times as large. So by Euler the variance of a constant is the sum, over the sources, of its
derivative by each source's variance times that variance. The derivatives are differences, of one
more pass of the filter a source; what no noise accounts for is the prior's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from triaxcal.dynamic.calibrate import DynamicResult
from triaxcal.dynamic.filterpass import run_pass
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.passdata import Reference, Task
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.dynamic.wander import Wander, wander_of
from triaxcal.model.types import FloatArray

STEP = 0.1
"""Of a source's variance: its derivative is good to a few per cent."""
PRIOR = "prior"


@dataclass(frozen=True)
class Source:
    """A source of noise: its name, and its keys of [noise]."""

    name: str
    keys: tuple[str, ...]


SOURCES = (
    Source("gyro noise", ("gyro_arw_deg_per_sqrt_h",)),
    Source(
        "accelerometer noise",
        ("accel_vrw_ug_per_sqrt_hz", "second_vrw_ug_per_sqrt_hz", "accel_lsb"),
    ),
    Source("table", ("table_sd_arcsec", "axis_wobble_arcsec")),
)
WANDERING = "wandering biases"


def variance_shares(recording: ImuRecording, result: DynamicResult) -> dict[str, FloatArray]:
    """Share of each source in the variance of each constant, shape (n,), by name; sum 1."""
    noise, root = result.noise, math.sqrt(1 - STEP)
    wander = wander_of(result.layout, noise, result.survey.duration_s)
    trials: dict[str, tuple[DataSheet, Wander]] = {}
    for source in SOURCES:
        stated = {key: getattr(noise, key) for key in source.keys}
        less = {key: value * root for key, value in stated.items() if value}
        if less:
            trials[source.name] = replace(noise, **less), wander
    if len(wander.columns):
        trials[WANDERING] = noise, _smaller(wander, root)
    whole = _variance(recording, result, noise, wander)
    shares = {}
    for name, trial in trials.items():
        left = _variance(recording, result, *trial)
        shares[name] = np.clip((1 - left / whole) / STEP, 0.0, 1.0)
    shares[PRIOR] = np.clip(1 - sum(shares.values()), 0.0, 1.0)
    return shares


def _smaller(wander: Wander, factor: float) -> Wander:
    """The same processes with deviations times `factor`."""
    known = wander.layout.states[: wander.constants]
    blocks = []
    for block in wander.layout.blocks:
        states = block.states
        if not set(states) <= set(known):
            states = tuple(replace(s, prior_sd=factor * s.prior_sd) for s in states)
        blocks.append(replace(block, states=states))
    return replace(wander, layout=Layout(tuple(blocks)), sd=factor * wander.sd)


def _variance(
    recording: ImuRecording, result: DynamicResult, noise: DataSheet, wander: Wander
) -> FloatArray:
    frame = replace(result.frame, layout=wander.layout)
    start = Reference(result.p, result.stage_p, result.heading_rad)
    done = run_pass(Task(recording, result.survey, frame, noise, wander), start, first=False)
    variance: FloatArray = (done.root**2).sum(axis=1)
    return variance
