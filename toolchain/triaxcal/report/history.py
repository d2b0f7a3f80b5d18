"""A unit's calibrations over time, for the terminal."""

from __future__ import annotations

from pathlib import Path

from triaxcal.base.screentext import table
from triaxcal.delivery.unit import Delivery
from triaxcal.uncertainty.history import (
    EN_MAX,
    Calibrated,
    Change,
    Repeatability,
    latest_change,
)


def history_text(
    serial: str, history: list[Calibrated], found: list[Change], repeat: Repeatability | None
) -> str:
    """Table of the changes, what repeats, and what contradicts."""
    head = ["calibration", "bias mg", "scale ppm", "cross urad", "En", "where"]
    rows = [
        [
            c.name, f"{c.bias_mg:+.4f}", f"{c.scale_ppm:+.1f}", f"{c.cross_axis_micro_rad:+.1f}",
            f"{c.en:.2f}", c.where.replace("°C", "degC"),
        ]
        for c in found
    ]  # fmt: skip
    lines = [
        f"{len(history)} calibrations of {serial}; largest change since the one before, at T0",
        "",
        *table(head, [[history[0].name, *"----", ""], *rows], left=(0, 5)),
        "",
        "En: the largest of 36 differences, divided by its expanded uncertainty (95 %).",
        f"Chance alone gives more than {EN_MAX:.2f} in one comparison of twenty; above that, the",
        "two calibrations contradict each other.",
    ]
    if repeat is None:
        lines.append("Repeatability: unknown, there are too few calibrations.")
    else:
        about = "about a straight line in time" if repeat.years else "about their mean"
        lines.append(
            f"Repeatability of {repeat.calibrations} calibrations {about}: bias "
            f"{repeat.bias_mg:.2g} mg, scale {repeat.scale_ppm:.2g} ppm, cross-axis "
            f"{repeat.cross_axis_micro_rad:.2g} urad."
        )
        if repeat.years and repeat.bias_mg_a_year is not None:
            lines.append(
                f"Ageing over {repeat.years:.1f} years, a year: bias {repeat.bias_mg_a_year:+.2g} "
                f"mg, scale {repeat.scale_ppm_a_year:+.2g} ppm."
            )
    lines += [contradiction(c) for c in found if c.contradicts]
    return "\n".join(lines)


def contradiction(change: Change) -> str:
    """Warning of a calibration that contradicts the one before."""
    unit = change.of_unit.replace("µ", "u")
    return (
        f"warning: calibration {change.name} contradicts {change.before}: "
        f"{change.where.replace('°C', 'degC')} changed by {_figure(change.by):+} {unit}, "
        f"{change.en:.1f} times the {_figure(change.expanded)} {unit} (95 %) that their "
        "uncertainties allow; the unit has aged or was damaged, or one of the two is wrong"
    )


def contradiction_of(folder: Path, delivery: Delivery) -> tuple[str, ...]:
    """Warning where a calibration contradicts the last one in the unit's history; else nothing.

    Raises
    ------
    RefusedError
        When the last one cannot be calibrated.
    """
    newest = Calibrated("now", None, delivery.measurements, delivery.calibration)
    change = latest_change(folder, delivery.unit, newest)
    return (contradiction(change),) if change is not None and change.contradicts else ()


def _figure(value: float) -> float:
    """Three figures."""
    return float(f"{value:.3g}")
