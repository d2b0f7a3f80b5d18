"""Standard deviations of [priors] that the poses contradict.

The scale of a group of constants is tried wider, with the constants and the noise integrated out.
Where the poses are more probable under the widest by a factor that the group's own prior gives once
in 1 / CHANCE recordings, the prior is contradicted. Twice the logarithm of that factor is held
against chi-square with one degree of freedom, of which half the probability lies at a narrower
scale; for groups of one and of three constants it is rarer than that.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace

import numpy as np

from triaxcal.fitting.core.outliers import CHANCE
from triaxcal.fitting.recorded.magnitude import fit_with_prior
from triaxcal.fitting.recorded.prior import Known
from triaxcal.fitting.recorded.scales import ScaleEvidence
from triaxcal.fitting.recorded.solution import ScalarFit
from triaxcal.fitting.recorded.trials import Judged
from triaxcal.model.positions import AXES
from triaxcal.model.terms import PRODUCT_AXES, PRODUCT_NAMES
from triaxcal.model.types import FloatArray
from triaxcal.unit.priors import PRIORS, Priors

_GROUPS = tuple(field.name for field in fields(Priors))
_STEP = math.sqrt(2.0)
"""Of the scales that are tried: nearer to each other than three constants show a scale."""
_WIDEST = 1e6


@dataclass(frozen=True)
class _Shown:
    """What the poses show of a constant of a group, in the unit of its key."""

    name: str
    value: float
    sd: float


@dataclass(frozen=True)
class _Wide:
    """A fit with wider priors, and the functions of temperature at T0."""

    fit: ScalarFit
    known: Known
    basis: FloatArray

    def at_t0(self) -> tuple[FloatArray, FloatArray, float]:
        """Constants (12,), their slopes by theta, and the mean scale factor."""
        constants = self.fit.constants() @ self.basis
        slopes = np.einsum("apk,p->ak", self.fit.constants_jacobian(), self.basis)
        return constants, slopes, float(constants[[0, 4, 8]].mean())


def contradicted(row: Judged, t0_degc: float) -> list[str]:
    """Sentences about priors that the poses contradict, of the fit with all terms."""
    known = row.trial.known
    assert known is not None
    stated = wide = known.priors
    evidence = ScaleEvidence(known, row.fit)
    keys: list[str] = []
    while len(keys) < len(_GROUPS):
        tried = [(*_wider(evidence, wide, key), key) for key in _GROUPS if key not in keys]
        gain, scale, key = max(tried)
        # chi-square with one degree of freedom, by the normal distribution; one of several groups.
        if 0.5 * math.erfc(math.sqrt(max(gain, 0.0))) * len(_GROUPS) > CHANCE:
            break
        wide = replace(wide, **{key: scale})
        keys.append(key)
    moved = _moved_zero(known)
    if not keys:
        return moved
    free = replace(known, priors=wide)
    fit = fit_with_prior(row.fit.model, row.fit.data, row.fit.gain_functions, free)
    basis = row.trial.basis_at(t0_degc)
    free_fit = _Wide(fit, free, basis)
    return moved + [_sentence(key, stated, free_fit) for key in keys]


def _moved_zero(known: Known) -> list[str]:
    """Biases so large that they are held near the poses' middle; counts may have any zero."""
    if known.nominal is None or not known.zero.any():
        return []
    zero_g, was = known.zero / known.nominal, known.priors.bias_g
    read = ", ".join(f"{v:+.3g}" for v in zero_g)
    now = float(f"{np.sqrt(np.mean(zero_g**2)):.2g}")
    text = (
        f"[priors] bias_g = {was:g}{_whose('bias_g', was)} is contradicted by the poses: 0 g reads "
        f"about {read} g in x, y, z, and the biases are held near that instead; check the unit and "
        f"the zero of the readings, or state bias_g = {now:g}"
    )
    return [text]


def _whose(key: str, value: float) -> str:
    return " (the default)" if value == getattr(Priors(), key) else ""


def _wider(evidence: ScaleEvidence, priors: Priors, key: str) -> tuple[float, float]:
    """Largest gain of ln evidence by a wider scale of one group, and that scale."""
    own = float(getattr(priors, key))
    base = evidence.log_evidence(priors)
    best, factor = (0.0, own), _STEP
    while factor < _WIDEST:
        gain = evidence.log_evidence(replace(priors, **{key: own * factor})) - base
        if gain <= best[0]:
            break
        best, factor = (gain, own * factor), factor * _STEP
    return best


def _sentence(key: str, stated: Priors, wide: _Wide) -> str:
    was, now = float(getattr(stated, key)), float(f"{getattr(wide.known.priors, key):.2g}")
    default, unit = float(getattr(Priors(), key)), _unit_of(key)
    largest = max(_SHOWN[key](wide), key=lambda shown: abs(shown.value))
    remove = f", or remove the key (default {default:g})" if default > was else ""
    return (
        f"[priors] {key} = {was:g}{_whose(key, was)} is contradicted by the poses: without it they "
        f"show {largest.name} = {largest.value:+.3g} +- {largest.sd:.2g}{unit}, and {now:g} is the "
        f"most probable standard deviation; it holds the constants too near to zero; check the "
        f"poses, or state {key} = {now:g}{remove}"
    )


def _unit_of(key: str) -> str:
    found = next(k.unit for k in PRIORS.keys if k.name == key)
    return f" {found}" if found else ""


def _shown(fit: ScalarFit, name: str, value: float, slope: FloatArray) -> _Shown:
    assert fit.posterior is not None
    return _Shown(name, value, float(np.sqrt(slope @ fit.posterior.covariance @ slope)))


def _cross(wide: _Wide) -> Iterator[_Shown]:
    constants, slopes, gain = wide.at_t0()
    for k, name in ((1, "Kxy"), (2, "Kxz"), (5, "Kyz")):
        yield _shown(wide.fit, f"{name} / K", constants[k] / gain, slopes[k] / gain)


def _scales(wide: _Wide) -> Iterator[_Shown]:
    constants, slopes, gain = wide.at_t0()
    mean = slopes[[0, 4, 8]].mean(axis=0)
    for k, name in ((0, "Kxx"), (4, "Kyy"), (8, "Kzz")):
        value = constants[k] / gain - 1.0
        yield _shown(wide.fit, f"{name} / K - 1", value, (slopes[k] - mean) / gain)


def _biases(wide: _Wide) -> Iterator[_Shown]:
    constants, slopes, gain = wide.at_t0()
    for i, axis in enumerate(AXES):
        value = (constants[9 + i] - wide.known.zero[i]) / gain
        yield _shown(wide.fit, f"U0{axis} / K", value, slopes[9 + i] / gain)


def _mean_scale(wide: _Wide) -> Iterator[_Shown]:
    _, slopes, gain = wide.at_t0()
    nominal = gain if wide.known.nominal is None else wide.known.nominal
    slope = slopes[[0, 4, 8]].mean(axis=0) / nominal
    yield _shown(wide.fit, "K / nominal - 1", gain / nominal - 1.0, slope)


def _own_squares(wide: _Wide) -> Iterator[_Shown]:
    yield from _quadratic(wide.fit, own=True)


def _products(wide: _Wide) -> Iterator[_Shown]:
    yield from _quadratic(wide.fit, own=False)


def _quadratic(fit: ScalarFit, *, own: bool) -> Iterator[_Shown]:
    first = len(fit.theta) - len(fit.model.quadratic)
    for k, pattern in enumerate(fit.model.quadratic):
        axis, product = (int(n) for n in np.argwhere(pattern)[0])
        if (PRODUCT_AXES[product] == (axis, axis)) != own:
            continue
        name = f"Q{AXES[axis]}.{PRODUCT_NAMES[product]}"
        slope = np.zeros(len(fit.theta))
        slope[first + k] = 1.0
        yield _shown(fit, name, float(fit.theta[first + k]), slope)


_SHOWN = {
    "cross_term_rad": _cross,
    "scale_factor": _scales,
    "own_square_g_per_g2": _own_squares,
    "product_g_per_g2": _products,
    "bias_g": _biases,
    "mean_scale": _mean_scale,
}
