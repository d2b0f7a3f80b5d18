"""Thermal hysteresis: heating against cooling at one temperature."""

from __future__ import annotations

import math
from statistics import NormalDist

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.halfcycles import (
    TURN_DEGC,
    Apart,
    half_cycles,
    heating_less_cooling,
    smoothed,
)
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray
from triaxcal.noise.study import NoiseStudy
from triaxcal.performance.figures import Chapter, Curve, Drawing, Figure
from triaxcal.performance.recorded import Recorded
from triaxcal.unit.recordedtest import StatedTest

_MICRO = 1e6
KEY, NAME, UNIT = "hysteresis", "thermal hysteresis", "micro-g"
DEFINITION = (
    "Largest difference of heating and cooling at one temperature, over the temperatures in which "
    "both were recorded, of means over 1 K. The interval holds that largest difference if all of "
    "them are within their own intervals, together 95 %. A thermometer that lags behind the sensor "
    "shows hysteresis too, in proportion to the rate."
)


def hysteresis_figures(
    test: StatedTest, recorded: Recorded, noise: NoiseStudy | None
) -> tuple[list[Figure], list[str], list[Drawing]]:
    """Figures of one thermal cycle; slow noise is in their intervals where it is known.

    Raises
    ------
    RefusedError
        Where there is no temperature, it does not move, or only one way.
    """
    if recorded.temp_degc is None:
        raise RefusedError(f"{test.where} temperature", "missing", expected="its column")
    temp, rate = smoothed(recorded.samples)
    halves = half_cycles(temp)
    ways = {half.rising for half in halves}
    if len(ways) < 2:
        found = f"no half-cycle: the temperature stays within {np.ptp(temp):.2g} degC"
        if ways:
            found = "only heating" if ways == {True} else "only cooling"
        expected = f"{TURN_DEGC:g} degC at least from one turn to the next, each way"
        remedy = "record a whole cycle"
        raise RefusedError(recorded.source, found, expected=expected, remedy=remedy)
    apart = heating_less_cooling(recorded.output_g, temp, halves)
    sd = _with_slow_noise(apart, recorded, noise)
    factor = NormalDist().inv_cdf(1.0 - 0.05 / (2.0 * len(apart.degc)))
    figures, fastest = [], float(np.abs(rate).max()) * 60.0
    for i, axis in enumerate(AXES):
        size = np.abs(apart.difference[:, i])
        k = int(size.argmax())
        low = max(float((size - factor * sd[:, i]).max()), 0.0)
        high = float((size + factor * sd[:, i]).max())
        how = (
            f"[{test.table}], {recorded.source}: {len(halves)} half-cycles, up to {fastest:.2g} "
            f"K/min; largest at {apart.degc[k]:.0f} degC"
        )
        figures.append(
            Figure(KEY, NAME, axis, UNIT, float(size[k]) * _MICRO, low * _MICRO, high * _MICRO, how)
        )
    notes = [] if noise is not None else [
        f"[{test.table}]: slow noise is not in the intervals; a test of kind rest would tell it"
    ]  # fmt: skip
    curves = tuple(
        Curve(axis, i, apart.degc, apart.difference[:, i] * _MICRO) for i, axis in enumerate(AXES)
    )
    return figures, notes, [Drawing("heating less cooling, micro-g", "degC", curves)]


def _with_slow_noise(apart: Apart, recorded: Recorded, noise: NoiseStudy | None) -> FloatArray:
    """Standard deviations (m, 3), with bias instability and random walk between the two passes.

    Of two means over a time T each, L apart, bias instability has the variance
    (2 B^2 / pi) (ln(L / T) + 2 ln 2), which is twice the Allan variance of neighbours (L = T); a
    random walk has K^2 L. The cycle's length stands for L.
    """
    if noise is None:
        return apart.sd
    span = float(recorded.time_s[-1])
    step = span / max(len(recorded.time_s) - 1, 1)
    result = np.empty_like(apart.sd)
    pass_s = apart.count.mean(axis=1) * step
    for i, axis in enumerate(noise.axes):
        B, K = axis.of("B").high, axis.of("K").value
        flicker = np.log(np.maximum(span / pass_s, 1.0)) + 2.0 * math.log(2.0)
        slow = 2.0 * B**2 / math.pi * flicker + K**2 * span
        result[:, i] = np.sqrt(apart.sd[:, i] ** 2 + slow)
    return result


def hysteresis_chapter(
    figures: list[Figure], notes: list[str], drawings: list[Drawing], why: str
) -> Chapter:
    """The chapter; `why` nothing was measured, where nothing was."""
    found = tuple(figures) or (Figure(KEY, NAME, "", UNIT, why=why),)
    return Chapter(KEY, "Thermal hysteresis", DEFINITION, found, tuple(notes), tuple(drawings))
