"""Sources of the terms beyond the twelve constants: quadratic terms and dT/dt.

With them the error of the force is D [a; 1; p(a)], D = [-N dK, -N dU0, dQ] (3 x 10), row by row.
"""

from __future__ import annotations

import math

import numpy as np

from triaxcal.fitting.core.recorded import RecordingFit, TermsCovariance
from triaxcal.fitting.tilter.squares import END_FORMS
from triaxcal.model.types import FloatArray
from triaxcal.uncertainty.propagation import ROWS, Curves, Propagation, square
from triaxcal.uncertainty.source import STUDENT, Source, direct

_LINEAR = tuple(10 * i + k for i in range(3) for k in range(4))
_QUADRATIC = tuple(10 * i + 4 + k for i in range(3) for k in range(6))


def pair_source(p: Curves) -> list[Source]:
    """Cross-coupling of a pair: the scatter of its readings on the dividing head.

    The covariance of an update has it in it.
    """
    pair = p.calibration.pair
    if pair is None or p.calibration.update:
        return []
    force = np.zeros((len(p.temps_degc), 30, 30))
    force[:, np.array(_QUADRATIC)[:, None], _QUADRATIC] = pair.covariance
    return [
        Source(
            key="quadratic_terms",
            name="the pair's cross-coupling",
            sd=math.sqrt(float(np.diag(pair.covariance).max())),
            unit="g/g^2",
            distribution=STUDENT,
            dof=float(pair.dof),
            origin="scatter of the pair's readings on the dividing head",
            advice="measure the pair in more positions, or leave [quadratic] cross_coupling out",
            force=force,
        )
    ]


def squares_source(p: Propagation) -> list[Source]:
    """Own-axis squares of the six positions: a wrong one moves the biases with it."""
    squares = p.calibration.squares
    if squares is None or not squares.included:
        return []
    # A Q_ii too large by one takes K_ki a_i^2 too little off the readings of its two positions.
    readings = p.dwell_gain * (p.forces_g**2)[:, None, :]
    factor = np.zeros((len(p.temps_degc), 30, 3))
    factor[:, _LINEAR] = p.force_factor(p.constants_factor(readings))
    factor[:, _QUADRATIC] = np.eye(18)[:, [0, 7, 14]]
    factor *= squares.sd_per_g
    return [
        Source(
            key="own_squares",
            name="the own-axis squares",
            sd=squares.sd_per_g,
            unit="g/g^2",
            distribution=STUDENT,
            dof=3.0,
            origin="squareness and noise in the half-sums over opposite positions, with the prior",
            advice="square the tilter's faces, or add check dwells",
            force=square(factor),
        )
    ]


def square_form_source(p: Propagation) -> list[Source]:
    """Own-axis squares that may be one wrong reading at an end: `fitting.tilter.squares`.

    The square and a wrong reading at each end that no check dwell has tested are as probable as one
    another: variance of their n errors (one is zero), sum of squares by n.
    """
    squares = p.calibration.squares
    if squares is None or not squares.included or not squares.untested.any():
        return []
    g = p.unit.gravity_g
    forms = 1 + squares.untested.sum(axis=1)
    size = np.abs(squares.per_g) / np.sqrt(forms) * (forms > 1)
    factor = np.zeros((30, 3, 2))
    for i in range(3):
        factor[_QUADRATIC[7 * i], i] = size[i] * squares.untested[i]
        factor[10 * i + i, i] = size[i] * squares.untested[i] * END_FORMS * g
    return [
        Source(
            key="square_form",
            name="the form of the nonlinearity between the positions",
            sd=float(2.0 * size.max() * g**2),
            unit="g",
            distribution="two or three values",
            origin="not tested between the positions: a square, or one wrong reading at an end",
            advice="measure check dwells between the axes",
            force=np.broadcast_to(square(factor.reshape(30, 6)), (len(p.temps_degc), 30, 30)),
        )
    ]


def rate_source(p: Curves, recording: RecordingFit) -> list[Source]:
    """The term in dT/dt, at the largest dT/dt that it was fitted in."""
    covariance = recording.terms.rate_g2
    if covariance is None or not recording.checked:
        return []
    values, vectors = np.linalg.eigh(covariance)
    factor = vectors * np.sqrt(np.maximum(values, 0.0))
    return [
        Source(
            key="rate",
            name="the term in dT/dt",
            sd=math.sqrt(float(np.diag(covariance).max())),
            unit="g",
            distribution=STUDENT,
            dof=float(recording.dof),
            origin="scatter of the poses, at the largest dT/dt of the recording",
            advice="record more poses while the temperature changes",
            force=direct(p, np.broadcast_to(factor, (len(p.temps_degc), 3, 3))),
        )
    ]


def with_quadratic(p: Curves, terms: TermsCovariance, force: FloatArray) -> FloatArray:
    """Covariance of D, (n, 12, 12), with Q of the same fit: (n, 30, 30) if there is one."""
    own, cross = terms.quadratic, terms.cross
    if own is None or cross is None:
        return force
    basis = p.calibration.shape.basis(p.temps_degc)
    order = np.argsort(ROWS)
    of_constants = np.einsum("apq,np->naq", cross, basis)[:, order]
    linear, quadratic = np.array(_LINEAR), np.array(_QUADRATIC)
    result = np.zeros((len(p.temps_degc), 30, 30))
    mixed = p.force_factor(of_constants)
    result[:, linear[:, None], linear] = force
    result[:, linear[:, None], quadratic] = mixed
    result[:, quadratic[:, None], linear] = np.swapaxes(mixed, 1, 2)
    result[:, quadratic[:, None], quadratic] = own
    return result
