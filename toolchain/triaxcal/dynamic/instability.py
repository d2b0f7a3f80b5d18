"""Bias instability from the recording, where [noise] does not state it.

A pose of some seconds alone does not show it: a mean over 3 s scatters by white noise several
times as much. All of them together do. The likelihood of a recording's innovations (`tape`)
says how much biases wander within it. With what is known of a sensor beforehand it gives a
distribution of B, for each triad, and the root of the expected B^2 is used: the variance that the
filter adds is then the expected one. Where the recording speaks against such a sensor, and for one
without any flicker, at odds of `AGAINST`, there is none. Where it does not decide, B is that
of a usual sensor.

Beforehand ln B is normal with the standard deviation 1. In its middle white noise and flicker have
equal Allan deviations at `USUAL_S`,

    N / sqrt(USUAL_S) = 0.664 B.

Published figures of seven MEMS gyros have that time between 1.7 and 324 s, of five accelerometers
between 4 and 141 s (docs/explanation/imu-filter.md): ln B is 0.3 below this middle on average, and
scatters by 0.9 and 0.6. So all of them are within 1.8 of the deviations assumed here, and the
middle rather expects too much flicker than too little.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from triaxcal.dynamic.blocks.base import DEG_PER_H
from triaxcal.dynamic.noise import MICRO_G, DataSheet
from triaxcal.dynamic.tape import Tape
from triaxcal.dynamic.wander import Wander
from triaxcal.model.types import FloatArray

USUAL_S = 10.0
PRIOR_LOG_SD = 1.0
OCTAVES = -4, 3
"""Of the usual figure: what is looked for."""
HALVINGS = 2
NONE = 2.0**-8
"""Of the usual figure: no flicker, for the filter."""
AGAINST = 10.0
"""Odds at which a recording has no flicker at all: strong evidence by H. Jeffreys, Theory of
Probability, appendix B. At 3, three of twelve recordings of 3 min lost flicker that they had. So 10
was set, and tried on twelve others."""


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


def expected(stated: DataSheet, tried: DataSheet, tape: Tape, wander: Wander) -> DataSheet:
    """Figures that [noise] does not state, from a pass with those `tried`; two digits."""
    names = [state.name for state in wander.layout.states]
    rate = np.array([name.startswith("rate") for name in names])
    force = np.array([name.startswith("force") for name in names])
    gyro, accel = tried.gyro_bias_instability_deg_per_h, tried.accel_bias_instability_ug
    assert gyro is not None
    assert accel is not None
    factor = np.ones(len(names))
    if stated.gyro_bias_instability_deg_per_h is None and rate.any():
        best = _expected(lambda s: tape.deviance(np.where(rate, s, factor)))
        factor[rate], gyro = max(best, NONE), gyro * best
    if stated.accel_bias_instability_ug is None and force.any():
        accel *= _expected(lambda s: tape.deviance(np.where(force, s, factor)))
    return replace(
        tried,
        gyro_bias_instability_deg_per_h=float(f"{gyro:.2g}"),
        accel_bias_instability_ug=float(f"{accel:.2g}"),
    )


def _expected(deviance: Callable[[float], float]) -> float:
    """Root of the expected square of the factor of the usual figure; 0 where there is no flicker.

    By trapezia over a grid of octaves that is halved where the factor is most likely.
    """
    none = deviance(2.0 ** OCTAVES[0] / 8)
    found = {o: deviance(2.0**o) for o in np.arange(OCTAVES[0], OCTAVES[1] + 1.0).tolist()}
    step = 1.0
    for _ in range(HALVINGS):
        step /= 2
        best = min(found, key=lambda octave: found[octave] + _surprise(octave))
        found |= {o: deviance(2.0**o) for o in (best - step, best + step)}
    x = np.array(sorted(found))
    prior = np.exp(-_surprise(x) / 2)
    likely = prior * np.exp(-(np.array([found[o] for o in x]) - min(found.values())) / 2)
    # In logarithms: a recording that the model does not describe has odds beyond any float.
    log_odds = math.log(_integral(likely, x) / _integral(prior, x))
    log_odds += (none - min(found.values())) / 2
    if log_odds < -math.log(AGAINST):
        return 0.0
    return math.sqrt(_integral(likely * 4.0**x, x) / _integral(likely, x))


def _surprise(octave: FloatArray) -> FloatArray:
    """-2 ln of the distribution known beforehand, but for a constant."""
    result: FloatArray = (np.asarray(octave) * math.log(2) / PRIOR_LOG_SD) ** 2
    return result


def _integral(y: FloatArray, x: FloatArray) -> float:
    return float(((y[1:] + y[:-1]) / 2) @ np.diff(x))
