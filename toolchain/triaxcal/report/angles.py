"""Errors over an angle: a table in words, and curves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from triaxcal.base.screentext import table
from triaxcal.fitting.table.anglecurves import AngleErrors
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray
from triaxcal.report.pictures.line_plot import COLOURS, Line, Panel, line_plot

_OF_ANGLES = (COLOURS[3], "#6b6b6b")
_STEEP = 20.0
"""Times the median: a panel is cut there, for an angle that stops to exist has no end."""


def angle_errors_text(found: AngleErrors, names: Sequence[str]) -> str:
    """Largest and rms error, and largest sensitivity, over the sweep."""
    rows = []
    for k, name in enumerate(names):
        error = found.angle_error_arcsec[:, k]
        rows.append(
            [
                name.replace("_", " "),
                f"{np.nanmax(np.abs(error)):.4g}",
                f"{np.sqrt(np.nanmean(error**2)):.4g}",
                *(f"{np.nanmax(np.abs(found.per_offset[:, k, i])):.4g}" for i in range(3)),
                *(f"{np.nanmax(np.abs(found.per_scale[:, k, i])):.4g}" for i in range(3)),
            ]
        )
    offsets = [f"1 mg of dS{a}" for a in AXES]
    scales = [f"1e-3 of dK{a}" for a in AXES]
    return "\n".join(table(["arcsec", "largest error", "rms", *offsets, *scales], rows))


def angle_errors_picture(found: AngleErrors, names: Sequence[str], swept: int) -> bytes:
    """Errors of (6) and (8), and the sensitivities of both angles, over the swept angle."""
    x = found.angles_deg[:, swept]
    label = f"{names[swept].replace('_', ' ')}, deg"
    force = [Line(AXES[i], COLOURS[i], x, found.force_error_g[:, i] * 1e3) for i in range(3)]
    panels = [Panel("error of a component, mg", label, force)]
    words = [name.replace("_", " ") for name in names]
    errors = found.angle_error_arcsec
    panels.append(
        _panel("error of the angles, arcsec", label, words, x, errors, colours=_OF_ANGLES)
    )
    for k, name in enumerate(words):
        for title, values in (
            (f"{name}: arcsec for 1 mg of bias", found.per_offset),
            (f"{name}: arcsec for 1e-3 of scale", found.per_scale),
        ):
            panels.append(_panel(title, label, AXES, x, values[:, k]))
    return line_plot("Errors over the angle", panels)


def _panel(
    title: str,
    label: str,
    names: Sequence[str],
    x: FloatArray,
    values: FloatArray,
    *,
    colours: Sequence[str] = COLOURS,
) -> Panel:
    """Lines of values (n, m). A line ends where its angle stops to exist, or runs away."""
    seen = np.abs(values[np.isfinite(values) & (values != 0.0)])
    edge = min(float(seen.max()), _STEEP * float(np.median(seen))) if len(seen) else 1.0
    lines = []
    for i, name in enumerate(names):
        kept = np.abs(values[:, i]) <= edge
        lines.append(Line(name, colours[i], x[kept], values[kept, i]))
    return Panel(title, label, lines, (), (-1.1 * edge, 1.1 * edge))
