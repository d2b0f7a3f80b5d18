"""Curves of both triads, and how well they are known at any temperature."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from triaxcal.dynamic.blocks.base import LOWER
from triaxcal.dynamic.blocks.block import StateBlock
from triaxcal.dynamic.thermalbasis import (
    GROUPS,
    OF_GYROS,
    Basis,
    over_temperature,
    prior_of_term,
)
from triaxcal.dynamic.thermalchoice import Choice, Curves, Fit, Scored
from triaxcal.dynamic.thermalparts import Information
from triaxcal.model.curves import PiecewisePolynomial, ThermalModel, on_common_breaks
from triaxcal.model.metrological import pack_constants
from triaxcal.model.types import FloatArray
from triaxcal.unit.site import STANDARD_GRAVITY_M_PER_S2

FULL = tuple((i, j) for i in range(3) for j in range(3))
_LIKELY = 1e-3
"""A candidate of less weight is left out of the uncertainty."""


def values_at(fit: Fit, block: StateBlock, temps_degc: FloatArray) -> FloatArray:
    """Constants of a block, SI, at temperatures (k,): shape (k, states)."""
    prior = np.array([s.prior_sd * s.per_unit for s in block.states])
    q = fit.q[fit.places[block.name]]
    values: FloatArray = (fit.shapes[block.name].basis(temps_degc) @ q.T) * prior
    return values


def covariance_at(fit: Fit, block: StateBlock, temps_degc: FloatArray, basis: Basis) -> FloatArray:
    """Covariance of a block's constants at each temperature, SI, shape (k, states, states).

    With what a group that is free in the fit may differ from its function.
    """
    prior = np.array([s.prior_sd * s.per_unit for s in block.states])
    places, values = fit.places[block.name], fit.shapes[block.name].basis(temps_degc)
    rows = [np.broadcast_to(values[:, None], (len(temps_degc), *places.shape))]
    columns = [places]
    free = over_temperature(block.name)
    if free in fit.places:
        ratio = np.array([prior_of_term(s) / s.prior_sd for s in block.states])
        rows.append(ratio[:, None] * basis(temps_degc)[:, None])
        columns.append(fit.places[free])
    row, column = np.concatenate(rows, axis=2), np.concatenate(columns, axis=1)
    own = fit.covariance[column[:, :, None, None], column[None, None]]
    found: FloatArray = np.einsum("kip,ipjq,kjq->kij", row, own, row)
    return found * np.outer(prior, prior)


def joint_covariance_at(
    fit: Fit, blocks: Sequence[StateBlock], temps_degc: FloatArray
) -> FloatArray:
    """Covariance of the constants of several blocks, one after the other, as `covariance_at`.

    By their functions alone: without what a group that is free may differ from its own.
    """
    rows = []
    for block in blocks:
        places, values = fit.places[block.name], fit.shapes[block.name].basis(temps_degc)
        for state, place in zip(block.states, places, strict=True):
            row = np.zeros((len(temps_degc), len(fit.covariance)))
            row[:, place] = values * (state.prior_sd * state.per_unit)
            rows.append(row)
    stacked = np.stack(rows, axis=1)
    found: FloatArray = stacked @ fit.covariance @ np.swapaxes(stacked, 1, 2)
    return found


def averaged_covariance(
    curves: Curves, known: Information, choice: Choice, block: StateBlock, temps_degc: FloatArray
) -> FloatArray:
    """As `covariance_at` of the chosen curves, with what other likely functions differ from them.

    Each candidate has its own covariance and its difference from the chosen curve, by its weight.
    """
    chosen = values_at(choice.fit, block, temps_degc)
    rows = [c for c in choice.candidates.get(block.name, ()) if c.weight > _LIKELY]
    rows = rows or [Scored(choice.fit.shapes[block.name], 0.0, 1.0)]
    total = np.zeros((len(temps_degc), len(block.states), len(block.states)))
    for row in rows:
        shapes = {**choice.fit.shapes, block.name: row.shape}
        fit = curves.fit(known, shapes, curves.free)
        off = values_at(fit, block, temps_degc) - chosen
        own = covariance_at(fit, block, temps_degc, curves.bases[block.name])
        total += row.weight * (own + off[:, :, None] * off[:, None, :])
    return total / sum(row.weight for row in rows)


def thermal_models(
    fit: Fit, t0_degc: float, gyro_t0_degc: float
) -> tuple[ThermalModel, ThermalModel]:
    """Twelve functions of accelerometer, readings in g of 9.80665 m/s^2, and gyro, in rad/s."""
    accel_bias, accel_matrix, gyro_bias, gyro_matrix = (_curves(fit, block) for block in GROUPS)
    g = STANDARD_GRAVITY_M_PER_S2
    return (
        ThermalModel(t0_degc, _triad(accel_bias, 1 / g, accel_matrix, LOWER, t0_degc)),
        ThermalModel(gyro_t0_degc, _triad(gyro_bias, 1.0, gyro_matrix, FULL, gyro_t0_degc)),
    )


def _curves(fit: Fit, block: StateBlock) -> PiecewisePolynomial:
    prior = np.array([s.prior_sd * s.per_unit for s in block.states])
    return fit.shapes[block.name].curves(fit.q[fit.places[block.name]] * prior[:, None])


def _triad(
    bias: PiecewisePolynomial,
    bias_unit: float,
    matrix: PiecewisePolynomial,
    elements: Sequence[tuple[int, int]],
    t0_degc: float,
) -> PiecewisePolynomial:
    """K = E + matrix and U0 = bias as twelve functions on the breaks of both."""
    breaks, origins, (own, other) = on_common_breaks((bias, matrix), t0_degc)
    order = own.shape[2]
    K = np.zeros((len(origins), 3, 3, order))
    for k, (i, j) in enumerate(elements):
        K[:, i, j] = other[:, k]
    K[:, range(3), range(3), 0] += 1.0
    U0 = own * bias_unit
    packed = np.stack([pack_constants(K[..., n], U0[..., n]) for n in range(order)], axis=-1)
    return PiecewisePolynomial(breaks, origins, packed)


@dataclass(frozen=True)
class Known:
    """Constants at some temperatures and how well they are known.

    Attributes
    ----------
    temps_degc, gyro_temps_degc : arrays, shape (k,)
        By the thermometers of accelerometers and gyros: the constants of each triad are at its own.
    names, units : tuples of str
    per_unit : array, shape (c,)
        SI value of each unit.
    value, sd : arrays, shape (k, c)
        SI.
    accel_sd_g, gyro_sd_rad_per_s : arrays, shape (k,)
        Of the compensated force, at 1 g along the worst axis, and of a gyro's rate at rest.
    """

    temps_degc: FloatArray
    gyro_temps_degc: FloatArray
    names: tuple[str, ...]
    units: tuple[str, ...]
    per_unit: FloatArray
    value: FloatArray
    sd: FloatArray
    accel_sd_g: FloatArray
    gyro_sd_rad_per_s: FloatArray


def known_at(
    curves: Curves,
    known: Information,
    choice: Choice,
    temps_degc: FloatArray,
    gyro_temps_degc: FloatArray,
) -> Known:
    """Constants of all groups at temperatures (k,) of each triad, with their uncertainty."""
    at = {b.name: gyro_temps_degc if b.name in OF_GYROS else temps_degc for b in GROUPS}
    states = [state for block in GROUPS for state in block.states]
    values = [values_at(choice.fit, block, at[block.name]) for block in GROUPS]
    variances = [
        np.diagonal(averaged_covariance(curves, known, choice, block, at[block.name]), 0, 1, 2)
        for block in GROUPS
    ]
    bias, matrix = variances[0], np.zeros((len(temps_degc), 3, 3))
    for k, (i, j) in enumerate(LOWER):
        matrix[:, i, j] = variances[1][:, k]
    g = STANDARD_GRAVITY_M_PER_S2
    # One force of 1 g along an axis: the worst of nine sums, correlations left out.
    force = np.sqrt((bias[:, :, None] + matrix * g**2).max(axis=(1, 2))) / g
    return Known(
        temps_degc,
        gyro_temps_degc,
        tuple(s.name for s in states),
        tuple(s.unit for s in states),
        np.array([s.per_unit for s in states]),
        np.concatenate(values, axis=1),
        np.sqrt(np.concatenate(variances, axis=1)),
        force,
        np.sqrt(variances[2].max(axis=1)),
    )
