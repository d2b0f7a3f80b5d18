"""Bias instability from the recording, where [noise] does not state it.

Poses of some seconds do not show it by themselves: a mean over 3 s scatters by white noise several
times as much. All of them together do. The likelihood of a recording's innovations (`evidence`)
says how much biases wander within it, and the most likely figure is taken, for each triad.

A recording that cannot tell leaves the likelihood flat. Then the figure is that of a usual sensor:
white noise and flicker have equal Allan deviations at `USUAL_S`,

    N / sqrt(USUAL_S) = 0.664 B.

Data sheets of MEMS sensors have this time between 2 and 50 s, so 10 s is within a factor of 2.3 of
all of them in B. So much is a sensor known beforehand, and a figure far from the usual costs as
much as one deviation of a normal distribution, but no more.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from triaxcal.dynamic.evidence import Tape
from triaxcal.dynamic.noise import DEG_PER_H, MICRO_G, DataSheet
from triaxcal.dynamic.wander import Wander

USUAL_S = 10.0
SMALLEST, LARGEST = 1 / 16, 16.0
"""Of the usual figure: what is looked for; below the smallest there is none."""
ROUNDS = 6
"""Each takes 0.62 of what was left of the interval."""


def usual(noise: DataSheet) -> DataSheet:
    """The figures of a usual sensor where none are stated."""
    gyro, accel = noise.gyro_bias_instability_deg_per_h, noise.accel_bias_instability_ug
    root = math.sqrt(USUAL_S)
    return replace(
        noise,
        gyro_bias_instability_deg_per_h=noise.rate_density / root / DEG_PER_H
        if gyro is None
        else gyro,
        accel_bias_instability_ug=noise.force_density() / root / MICRO_G
        if accel is None
        else accel,
    )


def most_likely(stated: DataSheet, tried: DataSheet, tape: Tape, wander: Wander) -> DataSheet:
    """Figures that [noise] does not state, from a pass with those `tried`, rounded to 2 digits."""
    names = [state.name for state in wander.layout.states]
    rate = np.array([name.startswith("rate") for name in names])
    force = np.array([name.startswith("force") for name in names])
    gyro, accel = tried.gyro_bias_instability_deg_per_h, tried.accel_bias_instability_ug
    assert gyro is not None
    assert accel is not None
    factor = np.ones(len(names))
    if stated.gyro_bias_instability_deg_per_h is None and rate.any():
        best = _lowest(lambda s: tape.deviance(np.where(rate, s, factor)))
        factor[rate], gyro = max(best, SMALLEST), gyro * best
    if stated.accel_bias_instability_ug is None and force.any():
        accel *= _lowest(lambda s: tape.deviance(np.where(force, s, factor)))
    return replace(
        tried,
        gyro_bias_instability_deg_per_h=float(f"{gyro:.2g}"),
        accel_bias_instability_ug=float(f"{accel:.2g}"),
    )


def _lowest(deviance: Callable[[float], float]) -> float:
    """Factor of the usual figure with the lowest deviance; 0 where that is the smallest."""

    def cost(log: float) -> float:
        return deviance(math.exp(log)) + min(log**2, 1.0)

    coarse = np.linspace(math.log(SMALLEST), math.log(LARGEST), 7)
    values = [cost(float(log)) for log in coarse[:5]]
    while len(values) < len(coarse) and values[-1] <= min(values):
        values.append(cost(float(coarse[len(values)])))
    k = int(np.argmin(values))
    if k == 0:
        return 0.0
    low, high = float(coarse[k - 1]), float(coarse[min(k + 1, len(coarse) - 1)])
    golden = (math.sqrt(5) - 1) / 2
    inner = [high - golden * (high - low), low + golden * (high - low)]
    costs = [cost(x) for x in inner]
    for _ in range(ROUNDS):
        if costs[0] < costs[1]:
            high, inner, costs = inner[1], [0.0, inner[0]], [0.0, costs[0]]
            inner[0] = high - golden * (high - low)
            costs[0] = cost(inner[0])
        else:
            low, inner, costs = inner[0], [inner[1], 0.0], [costs[1], 0.0]
            inner[1] = low + golden * (high - low)
            costs[1] = cost(inner[1])
    return math.exp(inner[int(np.argmin(costs))])
