"""A calibration as a matplotlib figure, for notebooks; matplotlib is an optional package."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.extras import install_command
from triaxcal.delivery.fitted import Fitted
from triaxcal.fitting.tilter.acceptance import dwells_in_range
from triaxcal.model.metrological import BIASES, CONSTANT_NAMES, force_from_voltage
from triaxcal.model.types import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SCALES, _CROSS = (0, 4, 8), (1, 2, 3, 5, 6, 7)
_LIMIT_COLOUR = "#b00020"


def calibration_figure(fitted: Fitted) -> Figure:
    """Scale factors, cross terms and biases over temperature, and residuals at the dwells.

    Raises
    ------
    RefusedError
        Where matplotlib is missing.
    """
    try:
        from matplotlib.figure import Figure as NewFigure  # noqa: PLC0415
    except ImportError as error:
        raise RefusedError(
            "plot",
            "the package matplotlib is missing",
            remedy="install it: " + install_command("plot"),
        ) from error
    figure = NewFigure(figsize=(10, 7), layout="constrained")
    axes = figure.subplots(2, 2)
    calibration = fitted.calibration
    temps = np.linspace(*calibration.range_degc, 201)
    constants = calibration.thermal.constants_at(temps)
    at_t0 = calibration.thermal.constants_at(calibration.thermal.t0_degc)
    scale = np.abs(at_t0[list(_SCALES)])
    panels = (
        (axes[0, 0], _SCALES, "scale factors against T0, ppm", 1e6 / at_t0[list(_SCALES)], at_t0),
        (axes[0, 1], _CROSS, "cross terms, mrad", 1e3 / scale[[0, 0, 1, 1, 2, 2]], 0 * at_t0),
        (axes[1, 0], BIASES, "biases, mg", 1e3 / scale, 0 * at_t0),
    )
    for axis, which, title, factor, zero in panels:
        index = list(which)
        lines = axis.plot(temps, (constants - zero)[:, index] * factor)
        for line, constant, f in zip(lines, index, factor, strict=True):
            line.set_label(CONSTANT_NAMES[constant])
            points = [(p.temp_degc, (p.constants - zero)[constant] * f) for p in calibration.points]
            if len(points) > 1:
                axis.plot(*zip(*points, strict=True), "o", markersize=4, color=line.get_color())
        _finish(axis, title)
    _residuals(axes[1, 1], fitted)
    figure.suptitle(f"{fitted.unit.name}, serial {fitted.unit.serial}: {calibration.shape.label}")
    return figure


def _residuals(axis: Axes, fitted: Fitted) -> None:
    unit, calibration = fitted.unit, fitted.calibration
    dwells = dwells_in_range(unit, calibration.range_degc, fitted.measurements)
    temps: FloatArray = np.array([d.temp_degc for d in dwells])
    voltage = np.array([d.voltage_v for d in dwells]).reshape(-1, 3)
    linear = force_from_voltage(calibration.thermal.constants_at(temps), voltage)
    force = calibration.terms.force_g(linear, np.array([d.rate_k_per_s for d in dwells]))
    error = (np.linalg.norm(force, axis=1) - unit.gravity_g) * 1e3
    checks = np.array([d.position.startswith("CP") for d in dwells], dtype=bool)
    for own, label, marker in ((~checks, "fitted dwells", "o"), (checks, "check dwells", "x")):
        if own.any():
            axis.plot(temps[own], error[own], marker, markersize=4, label=label)
    limit = unit.limits.over_range_g * 1e3
    if np.abs(error).max(initial=0.0) > limit / 10:
        axis.axhline(limit, color=_LIMIT_COLOUR, linewidth=1, label="limit over the range")
        axis.axhline(-limit, color=_LIMIT_COLOUR, linewidth=1)
    _finish(axis, "|a| - g at the dwells, mg")


def _finish(axis: Axes, title: str) -> None:
    axis.set_title(title, fontsize=10)
    axis.set_xlabel("temperature, °C")
    axis.grid(visible=True, alpha=0.3)
    axis.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))  # beside, not over, lines
