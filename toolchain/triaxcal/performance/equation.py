"""The model equation of each output at T0: every coefficient, or why it was not measured."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from triaxcal.model.positions import AXES
from triaxcal.model.terms import PRODUCT_AXES, PRODUCT_NAMES
from triaxcal.performance.figures import Chapter, Figure, with_expanded
from triaxcal.performance.known import Known, bias_slopes, ratio_slopes
from triaxcal.performance.nonlinear import Nonlinear, Term
from triaxcal.uncertainty.coverage import coverage_factor

EQUATION = (
    "E_i = K1_i (K0_i + a_i + sum_j d_ij a_j + K2_i a_i^2 + Koq_i a_i |a_i| + K3_i a_i^3 "
    "+ sum_jk K_jk a_j a_k)"
)
_MICRO = 1e6
_SHARE_MIN = 0.1
"""Of a value, that readings have to tell: below it, it is not measured."""
_ONE_G = (
    "at 1 g a scale factor takes up most of it; state it in [nonlinearity] where a centrifuge or "
    "another test beyond 1 g has shown it"
)


def equation_chapter(done: Known, terms: Nonlinear) -> Chapter:
    """Coefficients at T0 with their expanded uncertainty."""
    return Chapter(
        "equation",
        "Model equation",
        f"{EQUATION}, for each output i = x, y, z at {done.unit.t0_degc:g} degC; a in g of 9.80665 "
        "m/s^2 along the axes of the unit, j and k the other axes.",
        (*_linear(done), *_nonlinear(terms)),
        done.calibration.findings,
    )


def _linear(done: Known) -> Iterator[Figure]:
    constants, t0 = done.constants()[done.t0], done.t0
    calibration = done.calibration
    how = f"six positions at {len(calibration.points)} temperatures, by {calibration.estimator}"
    if calibration.recording is not None:
        how = f"{len(calibration.recording.residual_g)} poses: {calibration.recording.route}"
    for i, axis in enumerate(AXES):
        value, slopes = bias_slopes(constants, i)
        figure = Figure("bias", "bias K0", axis, "micro-g", how=how)
        yield with_expanded(figure, value * _MICRO, done.expanded(slopes, t0) * _MICRO)
    for i, axis in enumerate(AXES):
        figure = Figure(
            "scale_factor", "scale factor K1", axis, done.calibration.gain_unit, how=how
        )
        yield with_expanded(figure, float(constants[4 * i]), done.expanded(np.eye(12)[4 * i], t0))
    for i, axis in enumerate(AXES):
        for j in (k for k in range(3) if k != i):
            value, slopes = ratio_slopes(constants, i, j)
            figure = Figure(
                "cross_axis", "cross-axis sensitivity d", axis + AXES[j], "micro-rad", how=how
            )
            yield with_expanded(figure, value * _MICRO, done.expanded(slopes, t0) * _MICRO)


def _nonlinear(terms: Nonlinear) -> Iterator[Figure]:
    six = "the readings do not show it beside the other constants"
    for key, name, term, unit, why in (
        ("own_square", "own-axis square K2", terms.own_square, "micro-g/g^2", six),
        ("odd_square", "odd square Koq", terms.odd_square, "micro-g/g^2", _ONE_G),
        ("cube", "own-axis cube K3", terms.cube, "micro-g/g^3", _ONE_G),
    ):
        yield from _term(key, name, term, unit, why)
    yield from _products(terms)


def _term(key: str, name: str, term: Term | None, unit: str, why: str) -> Iterator[Figure]:
    if term is None:
        yield Figure(key, name, "", unit, why=why)
        return
    for i, axis in enumerate(AXES):
        yield _one(Figure(key, name, axis, unit), term, i)


def _one(figure: Figure, term: Term, *index: int) -> Figure:
    """Figure of one value of a term; not measured where the prior tells nearly all of it."""
    share, unit = float(term.share[index]), _MICRO
    expanded = coverage_factor(term.dof) * float(term.sd[index]) * unit
    if share < _SHARE_MIN:
        why = (
            f"{term.how} determines {100.0 * share:.0f} % of it; the prior alone is "
            f"±{expanded:.2g} {figure.unit}"
        )
        return replace(figure, why=why)
    with_how = replace(figure, how=term.measured(share))
    return with_expanded(with_how, float(term.value[index]) * unit, expanded)


def _products(terms: Nonlinear) -> Iterator[Figure]:
    name, unit = "cross-coupling K", "micro-g/g^2"
    products = terms.products
    if products is None:
        why = "six positions do not show it: a pair on a dividing head does, [quadratic]"
        yield Figure("cross_coupling", name, "", unit, why=why)
        return
    for k, product in enumerate(PRODUCT_NAMES):
        for i, axis in enumerate(AXES):
            if PRODUCT_AXES[k] != (i, i) and not np.isnan(products.sd[i, k]):
                figure = Figure("cross_coupling", f"{name}_{product}", axis, unit)
                yield _one(figure, products, i, k)
