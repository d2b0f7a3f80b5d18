"""Temperature sensitivities of bias and scale factor over the working range."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray
from triaxcal.performance.figures import Chapter, Curve, Drawing, Figure, by_key, with_expanded
from triaxcal.performance.known import Known, bias_slopes

_MICRO = 1e6
_DENSE = 101


def temperature_chapter(done: Known) -> Chapter:
    """Mean slope from the lowest to the highest temperature, and the steepest in between."""
    low, high = float(done.temps_degc[0]), float(done.temps_degc[-1])
    definition = (
        f"Mean sensitivity: value at {high:.4g} degC less that at {low:.4g} degC, by the "
        "difference of temperature. Steepest: largest slope of the curve in between, with its "
        "sign. The interval is an upper limit: what is common to both temperatures is not taken "
        "off."
    )
    if high - low < 1.0 or done.calibration.shape.parameters < 2:
        why = f"calibrated at {low:.4g} to {high:.4g} degC, with constants that do not change"
        figures = tuple(
            Figure(key, name, "", unit, why=why)
            for key, name, unit in (
                ("bias_temperature", "temperature sensitivity of the bias", "micro-g/K"),
                ("scale_temperature", "temperature sensitivity of the scale factor", "ppm/K"),
            )
        )
        return Chapter("temperature", "Temperature sensitivities", definition, figures)
    each = (
        *_figures(done, _bias, "bias", "bias", "micro-g/K"),
        *_figures(done, _scale, "scale", "scale factor", "ppm/K"),
    )
    figures = by_key(each)
    return Chapter(
        "temperature", "Temperature sensitivities", definition, figures, (), _drawings(done)
    )


def _bias(constants: FloatArray, _reference: FloatArray, axis: int) -> tuple[float, FloatArray]:
    return bias_slopes(constants, axis)


def _scale(constants: FloatArray, reference: FloatArray, axis: int) -> tuple[float, FloatArray]:
    """K_ii(T) / K_ii(T0); T0's own error, a common factor, is of second order."""
    slopes = np.zeros(12)
    slopes[4 * axis] = 1.0 / reference[4 * axis]
    return float(constants[4 * axis] / reference[4 * axis]), slopes


def _figures(
    done: Known,
    function: Callable[[FloatArray, FloatArray, int], tuple[float, FloatArray]],
    key: str,
    name: str,
    unit: str,
) -> Iterator[Figure]:
    constants = done.constants()
    first, last = 0, len(constants) - 1
    span = float(done.temps_degc[last] - done.temps_degc[first])
    how = f"the calibration, {done.calibration.shape.label}"
    dense = np.linspace(done.temps_degc[0], done.temps_degc[-1], _DENSE)
    curves = done.calibration.thermal.constants_at(dense)
    for i, axis in enumerate(AXES):
        at_low, of_low = function(constants[first], constants[done.t0], i)
        at_high, of_high = function(constants[last], constants[done.t0], i)
        expanded = done.expanded_difference(-of_low, of_high, first, last)
        figure = Figure(
            f"{key}_temperature", f"mean sensitivity of the {name}", axis, unit, how=how
        )
        scale = _MICRO / span
        yield with_expanded(figure, (at_high - at_low) * scale, expanded * scale)
        values = np.array([function(c, constants[done.t0], i)[0] for c in curves])
        slope = np.gradient(values, dense) * _MICRO
        k = int(np.abs(slope).argmax())
        yield Figure(
            f"{key}_temperature_steepest", f"steepest sensitivity of the {name}", axis, unit,
            float(slope[k]), how=f"{how}, at {dense[k]:.0f} degC",
        )  # fmt: skip


def _drawings(done: Known) -> tuple[Drawing, ...]:
    temps = np.linspace(done.temps_degc[0], done.temps_degc[-1], _DENSE)
    curves = done.calibration.thermal.constants_at(temps)
    at_t0 = done.constants()[done.t0]
    bias = [[bias_slopes(c, i)[0] - bias_slopes(at_t0, i)[0] for c in curves] for i in range(3)]
    scale = [curves[:, 4 * i] / at_t0[4 * i] - 1.0 for i in range(3)]
    return tuple(
        Drawing(
            title,
            "degC",
            tuple(Curve(AXES[i], i, temps, np.array(v[i]) * factor) for i in range(3)),
        )
        for title, v, factor in (
            ("bias less that at T0, mg", bias, 1e3),
            ("scale factor against that at T0, ppm", scale, 1e6),
        )
    )
