"""Composite error: largest deviation from the straight line over input range and temperature."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from triaxcal.delivery.verdict import UNCERTAINTY, Verdict
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray
from triaxcal.performance.figures import Chapter, Figure, with_expanded
from triaxcal.performance.known import Known
from triaxcal.performance.nonlinear import Nonlinear, Term
from triaxcal.uncertainty.coverage import coverage_factor, effective_dof

_MICRO = 1e6
_GRID = 81
DEFINITION = (
    "Largest deviation from a straight line over the input range and the working temperatures. At "
    "the readings: | |a| - g | of the compensated output, fitted and held out; data. Of the "
    "output: from the line K1 (K0 + a) of T0; the fitted constants over temperature with the terms "
    "beyond the line. Compensated: what those terms leave that the C does not have; its interval "
    "has the expanded uncertainty of a component at 1 g over temperature. Both are models of the "
    "unit; hysteresis, noise and repeatability are not in them."
)


def composite_chapter(done: Known, terms: Nonlinear, verdict: Verdict) -> Chapter:
    """Data first, then the models of each axis."""
    figures = (*_data(done, verdict), *_output(done, terms), *_compensated(done, terms))
    return Chapter("composite", "Composite error", DEFINITION, figures)


def _data(done: Known, verdict: Verdict) -> Iterator[Figure]:
    key, name, unit = "composite_data", "largest error of |a| at the readings", "micro-g"
    tested = [t for t in verdict.tested if t.what != UNCERTAINTY and t.dwells and not t.rms]
    if not tested:
        yield Figure(key, name, "", unit, why="no readings were held against a limit")
        return
    worst = max(tested, key=lambda t: t.largest_g)
    how = f"{worst.what} {worst.where}, {worst.dwells} dwells or poses"
    figure = Figure(key, name, "", unit, how=f"{how}; interval by the uncertainty of |a|")
    yield with_expanded(figure, worst.largest_g * _MICRO, done.u.length_g[1] * _MICRO)


def _bend(terms: Nonlinear, axis: int, force: FloatArray, *, left: bool) -> FloatArray:
    """Deviation from the line of an axis; of `left`, what the C leaves of it."""
    own, odd, cube = (
        0.0 if t is None else float(t.value[axis])
        for t in (terms.own_square, terms.odd_square, terms.cube)
    )
    # At 1 g the scale factor of the calibration has taken up the odd terms.
    Q = float(terms.in_c[axis, axis])
    result = own * force**2 + odd * (force * np.abs(force) - force) + cube * (force**3 - force)
    if left:
        result = result + Q * force**2 + 2.0 * own * Q * force**3
    return np.asarray(result)


def _bend_sources(terms: Nonlinear, axis: int, force: float) -> list[tuple[float, float]]:
    shapes = (force**2, abs(force * abs(force) - force), abs(force**3 - force))
    every: tuple[Term | None, ...] = (terms.own_square, terms.odd_square, terms.cube)
    return [
        (float(t.sd[axis]) * shape, t.dof)
        for t, shape in zip(every, shapes, strict=True)
        if t is not None
    ]


def _output(done: Known, terms: Nonlinear) -> Iterator[Figure]:
    limit = done.unit.reporting.input_range_g
    force = np.linspace(-limit, limit, _GRID)
    constants, t0 = done.constants(), done.t0
    for i, axis in enumerate(AXES):
        # U_i / K_ii(T0) less that of the line of T0.
        own, offset = constants[:, 4 * i], constants[:, 9 + i]
        at = own[t0]
        bent = _bend(terms, i, force, left=False)
        error = (offset - offset[t0])[:, None] / at
        error = error + (own / at - 1.0)[:, None] * force + bent
        k, n = np.unravel_index(int(np.abs(error).argmax()), error.shape)
        first, second = np.zeros(12), np.zeros(12)
        first[9 + i], first[4 * i] = 1.0 / at, force[n] / at
        second = -first
        expanded = math.hypot(
            done.expanded_difference(first, second, int(k), t0),
            _expanded(_bend_sources(terms, i, float(force[n]))),
        )
        value = float(error[k, n])
        how = (
            f"model, at {done.temps_degc[k]:.0f} degC and {force[n]:+.2g} g; "
            f"{100.0 * abs(value) / limit:.2f} % of the input range of {limit:g} g"
        )
        figure = Figure(
            "composite_output", "composite error of the output", axis, "micro-g", how=how
        )
        yield with_expanded(figure, value * _MICRO, expanded * _MICRO)


def _compensated(done: Known, terms: Nonlinear) -> Iterator[Figure]:
    key, name = "composite_compensated", "composite error of the compensated output"
    limit = done.unit.reporting.input_range_g
    every = {
        "own square": terms.own_square, "odd square": terms.odd_square, "cube": terms.cube
    }  # fmt: skip
    lacking = [name for name, term in every.items() if term is None]
    if len(lacking) == len(every):
        why = "no term beyond the straight line is known"
        yield Figure(key, name, "", "micro-g", why=why)
        return
    force = np.linspace(-limit, limit, _GRID)
    directions = np.eye(3)
    component = done.u.force_u_in(directions).max(axis=0)
    for i, axis in enumerate(AXES):
        bent = _bend(terms, i, force, left=True)
        n = int(np.abs(bent).argmax())
        own = _expanded(_bend_sources(terms, i, float(force[n])))
        expanded = math.hypot(float(component[i, i]), own)
        how = f"model, at {force[n]:+.2g} g; up to {limit:g} g"
        if limit > 1.0 and lacking:
            how += f"; not in it, because not measured: {', '.join(lacking)}; grows beyond 1 g"
        figure = Figure(key, name, axis, "micro-g", how=how)
        yield with_expanded(figure, float(bent[n]) * _MICRO, expanded * _MICRO)


def _expanded(sources: list[tuple[float, float]]) -> float:
    combined = math.sqrt(math.fsum(u * u for u, _ in sources))
    return coverage_factor(effective_dof(sources)) * combined if combined else 0.0
