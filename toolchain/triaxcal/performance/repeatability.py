"""Repeatability: over complete runs, over switching on and off, over days."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from triaxcal.fitting.core.calibration import Calibration
from triaxcal.performance.figures import Chapter, Figure, sd_interval
from triaxcal.performance.poweron import SWITCHING, PowerOn, switching_figures
from triaxcal.uncertainty.history import Repeatability

DEFINITION = (
    "Standard deviations, noise included, with the 95 % interval of their chi-squared "
    "distribution. Over runs: constants of one complete run about their mean, all axes and "
    "temperatures together. Over days: from calibration to calibration, about a straight line in "
    "time where there are four dated ones."
)
_MICRO = 1e6


def repeatability_chapter(
    calibration: Calibration,
    switched: Iterable[PowerOn],
    why_not_switched: str,
    days: Repeatability | None,
) -> Chapter:
    """Figures of all three."""
    found = [f for one in switched for f in switching_figures(one)]
    if not found:
        key, name, unit = SWITCHING
        found = [Figure(key, name, "", unit, why=why_not_switched)]
    figures = (*_runs(calibration), *found, *_days(days))
    return Chapter("repeatability", "Repeatability", DEFINITION, figures)


def _runs(calibration: Calibration) -> Iterator[Figure]:
    runs = calibration.runs
    rows = (
        ("runs_bias", "bias from run to run", "micro-g", 3, "bias_g"),
        ("runs_scale", "scale factor from run to run", "ppm", 3, "scale_ratio"),
        ("runs_cross", "cross-axis sensitivity from run to run", "micro-rad", 6, "cross_ratio"),
    )
    for key, name, unit, constants, attribute in rows:
        if runs is None:
            why = "one run only: no temperature was measured in more than one complete run"
            yield Figure(key, name, "", unit, why=why)
            continue
        sd = float(getattr(runs, attribute)) * _MICRO
        # A run may differ from the others alike at all temperatures: they count once.
        low, high = sd_interval(sd, float(constants * runs.dof) / runs.temperatures)
        how = (
            f"{runs.temperatures} temperatures measured in up to "
            f"{1 + runs.dof // runs.temperatures} complete runs"
        )
        yield Figure(key, name, "", unit, sd, low, high, how)


def _days(days: Repeatability | None) -> Iterator[Figure]:
    rows = (
        ("days_bias", "bias from calibration to calibration", "micro-g", "bias_mg", 1e3, 3),
        ("days_scale", "scale factor from calibration to calibration", "ppm", "scale_ppm", 1.0, 3),
        ("days_cross", "cross-axis sensitivity from calibration to calibration", "micro-rad",
         "cross_axis_micro_rad", 1.0, 6),
    )  # fmt: skip
    for key, name, unit, attribute, scale, constants in rows:
        if days is None:
            yield Figure(key, name, "", unit, why="fewer than three calibrations in history/")
            continue
        sd = float(getattr(days, attribute)) * scale
        dof = float(constants * (days.calibrations - (2 if days.years is not None else 1)))
        how = f"{days.calibrations} calibrations"
        how += "" if days.years is None else f" over {days.years:.2g} years, about a straight line"
        yield Figure(key, name, unit=unit, axis="", value=sd, how=how,
                     low=sd_interval(sd, dof)[0], high=sd_interval(sd, dof)[1])  # fmt: skip
