"""Vibration rectification: predicted with and without the terms of the C, and the C's own."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from triaxcal.model.metrological import unpack_constants
from triaxcal.model.positions import AXES
from triaxcal.model.terms import PRODUCT_AXES
from triaxcal.model.types import FloatArray
from triaxcal.performance.figures import Chapter, Figure, by_key, with_expanded
from triaxcal.performance.known import Known
from triaxcal.performance.nonlinear import Nonlinear
from triaxcal.performance.rectification import beyond, cube_shift, odd_shift, square_shift
from triaxcal.performance.shaken import Sensor, Shaken
from triaxcal.uncertainty.coverage import coverage_factor, effective_dof
from triaxcal.unit.vibration import Vibration

_MICRO = 1e6
_NEVER = 1e-12
"""Of the samples: as good as none clips."""
DEFINITION = (
    "Mean output under the stated vibration less that of the static force alone, predicted from "
    "own square, odd square and cube and, where they are known, products of two axes. Linear: by "
    "the twelve constants alone. Compensated: with the terms that the C has; what is left is the "
    "error of those terms. The C itself was run on a generated vibration with the same sensor."
)
Shake = Callable[[Vibration, FloatArray, Sensor], Shaken]


@dataclass(frozen=True)
class Shift:
    """Predicted shift of one output.

    Attributes
    ----------
    linear, compensated : tuple of two floats
        Value and expanded uncertainty, g.
    """

    linear: tuple[float, float]
    compensated: tuple[float, float]


def sensor_of(done: Known, terms: Nonlinear) -> Sensor:
    """The sensor at T0 by what is known of it; what is not measured is 0."""
    K, U0 = unpack_constants(done.constants()[done.t0])
    cross = np.zeros((3, 6)) if terms.products is None else terms.products.value.copy()
    cross[range(3), range(3)] = 0.0
    own, odd, cube = (
        np.zeros(3) if t is None else t.value
        for t in (terms.own_square, terms.odd_square, terms.cube)
    )
    return Sensor(K, U0, own, odd, cube, cross, done.unit.adc)


def predicted(vibration: Vibration, static_g: FloatArray, terms: Nonlinear, axis: int) -> Shift:
    """Shift of output `axis`; terms that are not measured count as 0, without uncertainty."""
    direction = np.array(vibration.direction)
    part, static = float(direction[axis]), float(static_g[axis])
    variance, amplitude = vibration.random_g2 * part**2, (vibration.sine_g or 0.0) * abs(part)
    square = square_shift(variance, amplitude)
    cubic = cube_shift(static, variance, amplitude)
    odd = odd_shift(static, variance, amplitude)
    Q = float(terms.in_c[axis, axis])
    value, left, sources, left_sources = 0.0, 0.0, [], []
    if (own := terms.own_square) is not None:
        K2, sd = float(own.value[axis]), float(own.sd[axis])
        value += K2 * square
        # (a + K2 a^2) + Q (a + K2 a^2)^2 = a + (K2 + Q) a^2 + 2 K2 Q a^3 + ...
        left += (K2 + Q) * square + 2.0 * K2 * Q * cubic
        sources.append((sd * square, own.dof))
        left_sources.append((sd * abs(square + 2.0 * Q * cubic), own.dof))
    for term, shift in ((terms.odd_square, odd), (terms.cube, cubic)):
        if term is not None:
            value += float(term.value[axis]) * shift
            left += float(term.value[axis]) * shift
            found = (float(term.sd[axis]) * abs(shift), term.dof)
            sources.append(found)
            left_sources.append(found)
    for k, (i, j) in enumerate(PRODUCT_AXES):
        if terms.products is None or (i, j) == (axis, axis):
            continue
        together = float(direction[i] * direction[j]) * vibration.mean_square_g2
        K_jk = float(terms.products.value[axis, k])
        value += K_jk * together
        left += (K_jk + float(terms.in_c[axis, k])) * together
        sd = float(np.nan_to_num(terms.products.sd[axis, k]))
        sources.append((sd * abs(together), terms.products.dof))
        left_sources.append((sd * abs(together), terms.products.dof))
    return Shift((value, _expanded(sources)), (left, _expanded(left_sources)))


def _expanded(sources: list[tuple[float, float]]) -> float:
    combined = math.sqrt(math.fsum(u * u for u, _ in sources))
    return coverage_factor(effective_dof(sources)) * combined if combined else 0.0


def clipped_share(vibration: Vibration, static_g: FloatArray, sensor: Sensor, axis: int) -> float:
    """Predicted share of an output's codes at the ends of the converter."""
    row, offset = sensor.gain[axis], float(sensor.offset[axis])
    static = float(row @ static_g)
    part = float(row @ np.array(vibration.direction))
    variance, amplitude = vibration.random_g2 * part**2, (vibration.sine_g or 0.0) * abs(part)
    lsb = sensor.adc.volts_per_code
    high, low = sensor.adc.code_max * lsb - offset, sensor.adc.code_min * lsb - offset
    share = beyond(static, variance, amplitude, high) + beyond(-static, variance, amplitude, -low)
    return share if share > _NEVER else 0.0


def vibration_chapter(
    done: Known, terms: Nonlinear, stated: Mapping[str, Vibration], shake: Shake | None, why: str
) -> Chapter:
    """Figures of every [vibration.NAME]; `why` the C was not run, where `shake` is None."""
    title = "Vibration rectification"
    if not stated:
        figure = Figure(
            "vibration", "shift of the mean", "", "micro-g", why="no [vibration.NAME] in unit.toml"
        )
        return Chapter("vibration", title, DEFINITION, (figure,))
    if terms.own_square is None and terms.odd_square is None and terms.cube is None:
        none = "neither own square, odd square nor cube is known"
        figure = Figure("vibration", "shift of the mean", "", "micro-g", why=none)
        return Chapter("vibration", title, DEFINITION, (figure,))
    figures: list[Figure] = []
    notes: list[str] = [why] if why else []
    lacking = [
        name
        for name, term in (
            ("own square", terms.own_square),
            ("odd square", terms.odd_square),
            ("cube", terms.cube),
        )
        if term is None
    ]
    if lacking:
        notes.append(f"not in the prediction, because not measured: {', '.join(lacking)}")
    for name, vibration in stated.items():
        found, words = _one(done, terms, name, vibration, shake)
        figures += found
        notes += words
    return Chapter("vibration", title, DEFINITION, tuple(figures), tuple(notes))


def _one(
    done: Known, terms: Nonlinear, name: str, vibration: Vibration, shake: Shake | None
) -> tuple[list[Figure], list[str]]:
    static = np.array(vibration.static_g or (0.0, 0.0, done.unit.gravity_g))
    sensor = sensor_of(done, terms)
    ran = shake(vibration, static, sensor) if shake is not None else None
    how = f"[vibration.{name}], {math.sqrt(vibration.mean_square_g2):.4g} g rms"
    figures: list[Figure] = []
    notes: list[str] = []
    for i in range(3):
        shift = predicted(vibration, static, terms, i)
        if shift.linear == (0.0, 0.0):  # not shaken, and no product of it is known
            continue
        figures += _predicted(shift, vibration, AXES[i], name, how)
        if ran is not None:
            figures.append(_measured(ran, i, name, how))
        share = clipped_share(vibration, static, sensor, i)
        shown = share if ran is None else max(share, float(ran.clipped[i]))
        figures.append(
            Figure(
                "vibration_clipped",
                f"{name}: share of the codes that clip",
                AXES[i],
                "%",
                share * 100.0,
                how=f"{how}, by its distribution",
            )
        )
        if shown > 1e-9:
            ends = done.unit.adc
            notes.append(
                f"[vibration.{name}]: output {AXES[i]} clips at the codes {ends.code_min} and "
                f"{ends.code_max} in {shown:.2g} of the samples; the prediction is without clipping"
                + ("" if ran is None else ", the run of the C with it")
            )
    return list(by_key(figures)), notes


def _predicted(
    shift: Shift, vibration: Vibration, axis: str, called: str, how: str
) -> Iterator[Figure]:
    rows: list[tuple[str, str, tuple[float, float]]] = [
        ("vibration_linear", f"{called}: shift by the twelve constants alone", shift.linear),
        ("vibration_compensated", f"{called}: shift of the compensated output", shift.compensated),
    ]
    for key, name, (value, expanded) in rows:
        figure = Figure(key, name, axis, "micro-g", how=f"{how}, predicted")
        yield with_expanded(figure, value * _MICRO, expanded * _MICRO)
        scale = _MICRO / vibration.mean_square_g2
        figure = Figure(
            f"{key}_coefficient", f"{name}, by g^2", axis, "micro-g/g^2", how=f"{how}, predicted"
        )
        yield with_expanded(figure, value * scale, expanded * scale)


def _measured(ran: Shaken, axis: int, called: str, how: str) -> Figure:
    figure = Figure(
        "vibration_c", f"{called}: shift of the compiled C", AXES[axis], "micro-g",
        how=f"{how}, {ran.samples} generated samples, statistical interval"
        + (f"; status not good in {ran.flagged:.2g} of them" if ran.flagged else ""),
    )  # fmt: skip
    return with_expanded(
        figure, float(ran.shift_g[axis]) * _MICRO, float(ran.expanded_g[axis]) * _MICRO
    )
