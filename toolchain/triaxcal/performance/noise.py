"""Noise at rest, as a chapter: the five coefficients, and the floor of the Allan deviation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from triaxcal.noise.allan import FLICKER
from triaxcal.noise.coefficients import KINDS, allan_variance
from triaxcal.noise.stretch import even_stretch
from triaxcal.noise.study import AxisNoise, NoiseStudy, study_noise
from triaxcal.performance.figures import Chapter, Curve, Drawing, Figure
from triaxcal.performance.recorded import Recorded
from triaxcal.unit.recordedtest import StatedTest

BY_UNIT = {"Q": "{} s", "N": "{}/sqrt(Hz)", "B": "{}", "K": "{}/sqrt(s)", "R": "{}/s"}
"""Unit of each coefficient, of a signal in a unit."""
MICRO_G = "micro-g"
_MICRO = 1e6
DEFINITION = (
    "Coefficients of IEEE Std 952, two-sided densities: the Allan variance is 3 Q^2/tau^2 + "
    "N^2/tau + (2 ln 2/pi) B^2 + K^2 tau/3 + R^2 tau^2/2. They are the most probable ones of the "
    "spectrum, all five together. One whose interval begins at 0 is not determined: its upper "
    "limit is given. Lowest Allan deviation: the minimum of the overlapping Allan deviation by "
    "0.664."
)


def noise_of(test: StatedTest, recorded: Recorded) -> NoiseStudy:
    """Noise of the first file of a test: of the compensated output where there is one.

    Raises
    ------
    RefusedError
        Where the clock is uneven, or the recording too short.
    """
    part = even_stretch(recorded.samples)
    signal = recorded.output_g if recorded.compensated_g is None else recorded.compensated_g
    found = study_noise(
        recorded.source, signal[part.start : part.stop], part.step_s, test.keys.longest_tau_s
    )
    return NoiseStudy(
        found.source, found.axes, found.step_s, found.duration_s,
        (*recorded.findings, *part.findings, *found.findings),
    )  # fmt: skip


def noise_figures(
    study: NoiseStudy, how: str, unit: str = MICRO_G, scale: float = _MICRO
) -> Iterator[Figure]:
    """Five coefficients of each axis, then the lowest Allan deviations.

    `scale` is what the study's signal is in `unit`.
    """
    for k, kind in enumerate(KINDS):
        for axis in study.axes:
            c = axis.coefficients[k]
            value, low = (c.value * scale, c.low * scale) if c.determined else (None, None)
            yield Figure(
                f"noise_{kind.symbol}", f"{kind.name} {kind.symbol}", axis.axis,
                BY_UNIT[kind.symbol].format(unit), value, low, c.high * scale,
                how if c.determined else f"{how}: not determined",
            )  # fmt: skip
    for axis in study.axes:
        yield _floor(axis, study, how, unit, scale / FLICKER)


def _floor(axis: AxisNoise, study: NoiseStudy, how: str, unit: str, scale: float) -> Figure:
    key, name = "allan_floor", "lowest Allan deviation / 0.664"
    if axis.allan is None:
        return Figure(key, name, axis.axis, unit, why=" ".join(study.findings[-1:]))
    k, curve = axis.allan.floor, axis.allan
    last = k == len(curve.tau_s) - 1
    more = "; still falling there, record longer" if last else ""
    return Figure(
        key, name, axis.axis, unit, float(curve.deviation[k]) * scale, float(curve.low[k]) * scale,
        float(curve.high[k]) * scale, f"{how}, at {curve.tau_s[k]:.3g} s{more}",
    )  # fmt: skip


def allan_drawing(
    study: NoiseStudy, unit: str = MICRO_G, scale: float = _MICRO
) -> tuple[Drawing, ...]:
    """Allan deviation of each axis, and that of the coefficients."""
    curves = []
    for i, axis in enumerate(study.axes):
        if axis.allan is None:
            return ()
        tau = axis.allan.tau_s
        model = sum(c.value**2 * allan_variance(c.kind, tau) for c in axis.coefficients)
        curves.append(Curve(axis.axis, i, tau, axis.allan.deviation * scale))
        curves.append(Curve(f"{axis.axis}, coefficients", i, tau, np.sqrt(model) * scale, True))
    title = f"Allan deviation, {unit}"
    return (Drawing(title, "averaging time, s", tuple(curves), powers=True),)


def noise_chapter(
    found: Sequence[tuple[StatedTest, NoiseStudy]], reasons: list[str], why: str
) -> Chapter:
    """The chapter; `why` nothing was measured, where nothing was."""
    if not found:
        figures = tuple(
            Figure(
                f"noise_{k.symbol}",
                f"{k.name} {k.symbol}",
                "",
                BY_UNIT[k.symbol].format(MICRO_G),
                why=why,
            )
            for k in KINDS
        )
        return Chapter("noise", "Noise at rest", DEFINITION, figures)
    figures = tuple(
        f
        for test, study in found
        for f in noise_figures(study, f"[{test.table}], {study.source}, {study.duration_s:.4g} s")
    )
    notes = (*reasons, *(n for _, study in found for n in study.findings))
    drawings = tuple(d for _, study in found for d in allan_drawing(study))
    return Chapter("noise", "Noise at rest", DEFINITION, figures, notes, drawings)
