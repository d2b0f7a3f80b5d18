"""Warm-up after switching on, and how well the output repeats from one switching-on to the next."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray
from triaxcal.performance.figures import (
    Chapter,
    Curve,
    Drawing,
    Figure,
    by_key,
    mean_of_runs,
    sd_interval,
    with_expanded,
)
from triaxcal.performance.recorded import Recorded
from triaxcal.performance.transient import Transient, fit_transient
from triaxcal.unit.recordedtest import StatedTest

_MICRO = 1e6
_LENGTH = 3.0
"""Time constants that a recording has to last: what is left then is 5 % of the amplitude."""
_SAMPLES_MIN = 64
_DRAWN = 400
_STEADY_DEGC = 0.5
DEFINITION = (
    "The output after switching on is fitted by a steady value and one or two exponentials, in "
    "noise that is white and a random walk. Amplitude: output at the moment of switching on less "
    "the steady output. Time to settle: after it, the fitted transient stays within the stated "
    "band about the steady output. Several switchings-on: mean over them."
)


@dataclass(frozen=True)
class PowerOn:
    """The transients of one test.

    Attributes
    ----------
    test : StatedTest
    runs : tuple of Recorded
    output, compensated : lists of runs of three Transients
        `compensated` is empty where the temperature is not recorded in every run.
    """

    test: StatedTest
    runs: tuple[Recorded, ...]
    output: list[list[Transient]]
    compensated: list[list[Transient]]

    @property
    def judged(self) -> list[list[Transient]]:
        """Those of which the repeatability is taken: compensated ones if there are any."""
        return self.compensated or self.output


def power_on(test: StatedTest, runs: tuple[Recorded, ...]) -> PowerOn:
    """Transients of a test, each file a run.

    Raises
    ------
    RefusedError
        When the start is not in the recording, or it ends too early.
    """
    first = test.keys.first_sample_s
    if first is None:
        raise RefusedError(
            f"{test.where} first_sample_s",
            "missing: the recording does not tell when the unit was switched on",
            expected="time from switching on to the first sample",
        )
    for run in runs:
        _refuse_samples(run)
    output = [_fits(run, run.output_g, first) for run in runs]
    _refuse_part(runs, output, first)
    compensated = []
    if all(run.compensated_g is not None for run in runs):
        compensated = [
            _fits(r, r.compensated_g, first) for r in runs if r.compensated_g is not None
        ]
    return PowerOn(test, runs, output, compensated)


def _refuse_samples(run: Recorded) -> None:
    if len(run.time_s) < _SAMPLES_MIN:
        found, expected = f"{len(run.time_s)} samples", f"{_SAMPLES_MIN} at least"
        raise RefusedError(run.source, found, expected=expected, remedy="record longer")
    for i, axis in enumerate(AXES):
        if run.output_g[:, i].min() == run.output_g[:, i].max():
            raise RefusedError(
                run.source,
                f"output {axis} has the same value throughout",
                expected="readings",
                remedy="record it with more digits, or check the column",
            )


def temperature_notes(found: PowerOn) -> Iterator[str]:
    """Where the temperature was not the same throughout: the output follows it."""
    for run in found.runs:
        if run.temp_degc is not None and np.ptp(run.temp_degc) > _STEADY_DEGC:
            yield (
                f"{run.source}: {run.temp_degc.min():.1f} to {run.temp_degc.max():.1f} degC; what "
                "the output makes of it is in its transient"
            )


def _fits(run: Recorded, signal: FloatArray, first_s: float) -> list[Transient]:
    time = run.time_s + first_s
    return [fit_transient(time, signal[:, i]) for i in range(3)]


def _alike(runs: Sequence[Transient]) -> list[Transient]:
    """Those with as many time constants as most; more, where two numbers are as frequent."""
    counts = [len(t.tau_s) for t in runs]
    k = max(set(counts), key=lambda c: (counts.count(c), c))
    return [t for t in runs if len(t.tau_s) == k]


def _refuse_part(runs: tuple[Recorded, ...], fits: list[list[Transient]], first_s: float) -> None:
    """Refuse recordings that lack the start of the transient, or its end."""
    span = min(float(run.time_s[-1]) for run in runs)
    where = runs[0].source if len(runs) == 1 else f"{runs[0].source} to {runs[-1].source}"
    for i, axis in enumerate(AXES):
        alike = _alike([run[i] for run in fits])
        if not len(alike[0].tau_s):
            continue
        fastest, slowest = (float(np.median([t.tau_s[k] for t in alike])) for k in (0, -1))
        if first_s > fastest:
            raise RefusedError(
                where,
                f"the first sample is {first_s:g} s after switching on, and output {axis} has a "
                f"time constant of {fastest:.3g} s",
                expected="a recording from the start of the transient",
                remedy="start the logger before the unit",
            )
        if span < _LENGTH * slowest:
            raise RefusedError(
                where,
                f"{span:.4g} s long, and output {axis} has a time constant of {slowest:.3g} s",
                expected=f"{_LENGTH:g} time constants at least",
                remedy="record longer",
            )


def warm_up_figures(found: PowerOn) -> Iterator[Figure]:
    """Time constants, amplitudes and times to settle of each output."""
    for i, axis in enumerate(AXES):
        yield from _axis(found, [run[i] for run in found.output], axis, "")
        if found.compensated:
            runs = [run[i] for run in found.compensated]
            yield from _axis(found, runs, axis, "_compensated")


def _axis(found: PowerOn, runs: list[Transient], axis: str, which: str) -> Iterator[Figure]:
    alike = _alike(runs)
    k = len(alike[0].tau_s)
    of = "of the compensated output" if which else "of the output"
    how = f"[{found.test.table}], {len(alike)} of {len(runs)} switchings-on"
    names = [""] if k < 2 else ["_fast", ""]
    if not k:
        limit = max(t.limit for t in alike) * _MICRO
        yield Figure(
            f"warm_up_amplitude{which}", f"amplitude {of}", axis, "micro-g", None, None, limit,
            f"{how}: no transient is seen",
        )  # fmt: skip
        return
    for n, which_one in enumerate(names):
        words = " of the faster part" if which_one else ""
        log_tau = np.array([math.log(t.tau_s[n]) for t in alike])
        sd = np.array([math.sqrt(t.covariance[n, n]) for t in alike])
        mean, expanded = mean_of_runs(log_tau, sd)
        tau = math.exp(mean)
        yield Figure(
            f"warm_up_time_constant{which_one}{which}", f"time constant{words} {of}", axis, "s",
            tau, tau * math.exp(-expanded), tau * math.exp(expanded), how,
        )  # fmt: skip
        amplitude = np.array([t.amplitude[n] for t in alike])
        sd = np.array([math.sqrt(t.covariance[k + n, k + n]) for t in alike])
        mean, expanded = mean_of_runs(amplitude, sd)
        figure = Figure(
            f"warm_up_amplitude{which_one}{which}", f"amplitude{words} {of}", axis, "micro-g",
            how=how,
        )  # fmt: skip
        yield with_expanded(figure, mean * _MICRO, expanded * _MICRO)
    band = found.test.keys.settled_within_micro_g
    settled = np.array([t.settled_s(band / _MICRO) for t in alike])
    figure = Figure(
        f"warm_up_settling{which}", f"time to settle within {band:g} micro-g {of}", axis, "s",
        0.0, how=f"{how}: the transient stays within the band",
    )  # fmt: skip
    if settled.any():
        mean, expanded = mean_of_runs(settled[:, 0], settled[:, 1])
        figure = with_expanded(replace(figure, how=how), mean, expanded)
    yield figure


SWITCHING = ("switching", "repeatability from one switching-on to the next", "micro-g")


def switching_figures(found: PowerOn) -> Iterator[Figure]:
    """Standard deviation of the steady output over the runs."""
    runs = len(found.runs)
    key, name, unit = SWITCHING
    if runs < 2:
        why = f"[{found.test.table}] has one switching-on: two at least are needed"
        yield Figure(key, name, "", unit, why=why)
        return
    of = "compensated output" if found.compensated else "output, its temperature as it was"
    for i, axis in enumerate(AXES):
        steady = np.array([run[i].steady for run in found.judged])
        sd = float(np.std(steady, ddof=1)) * _MICRO
        low, high = sd_interval(sd, runs - 1.0)
        how = f"[{found.test.table}], steady {of} of {runs} switchings-on, standard deviation"
        yield Figure(key, name, axis, unit, sd, low, high, how)


def warm_up_chapter(found: Sequence[PowerOn], notes: list[str], why: str) -> Chapter:
    """The chapter; `why` nothing was measured, where nothing was."""
    figures = tuple(f for one in found for f in by_key(warm_up_figures(one))) or tuple(
        Figure(key, name, "", unit, why=why)
        for key, name, unit in (
            ("warm_up_time_constant", "time constant", "s"),
            ("warm_up_amplitude", "amplitude", "micro-g"),
            ("warm_up_settling", "time to settle", "s"),
        )
    )
    drawings = tuple(_drawing(one) for one in found)
    return Chapter(
        "warm_up", "Warm-up after switching on", DEFINITION, figures, tuple(notes), drawings
    )


def _drawing(found: PowerOn) -> Drawing:
    """First run: the output less its steady value, averaged, with the fitted transient."""
    run, curves = found.runs[0], []
    step = max(1, len(run.time_s) // _DRAWN)
    count = len(run.time_s) // step * step
    first = found.test.keys.first_sample_s or 0.0
    time = run.time_s[:count].reshape(-1, step).mean(axis=1) + first
    for i, axis in enumerate(AXES):
        fit = found.output[0][i]
        mean = run.output_g[:count, i].reshape(-1, step).mean(axis=1)
        curves.append(Curve(axis, i, time, (mean - fit.steady) * _MICRO))
        if len(fit.tau_s):
            curves.append(Curve(f"{axis}, fitted", i, time, fit.at(time) * _MICRO, dashed=True))
    return Drawing(f"output less its steady value, {run.source}, micro-g", "s", tuple(curves))
