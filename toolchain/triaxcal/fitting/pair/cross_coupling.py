"""Cross-coupling coefficients from an orthogonal pair of accelerometers on a dividing head, P3.

`model` has the equations, `recursion` the same estimate position after position.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.recorded import PairTerms
from triaxcal.fitting.pair.checks import doubtful_position, refuse_other_readings
from triaxcal.fitting.pair.model import (
    NAMES,
    condition_number,
    design,
    half_square,
    half_square_sd,
)
from triaxcal.fitting.pair.recursion import believed
from triaxcal.model.terms import PRODUCT_NAMES, Terms
from triaxcal.model.types import FloatArray
from triaxcal.readings.pair import read_pair
from triaxcal.unit.description import UnitDescription

CONDITION_MAX = 100.0
SIGNIFICANT_SD = 2.0


@dataclass(frozen=True)
class PairFit:
    """Coefficients in the order of `NAMES`: eight, or seven without K3.

    Attributes
    ----------
    values, sd : arrays, shape (8,)
    covariance : array, shape (8, 8)
    residual_g2 : array, shape (n,)
        Of Z.
    condition : float
        Of H, its columns scaled to length 1.
    noise_ratio : float or None
        Rms residual over the stated standard deviations, where there are some.
    doubtful : str
        The position that the others contradict, "" if there is none.
    """

    values: FloatArray
    sd: FloatArray
    covariance: FloatArray
    residual_g2: FloatArray
    condition: float
    doubtful: str
    noise_ratio: float | None = None


def fit_pair(
    source: str,
    theta_rad: FloatArray,
    a_g: FloatArray,
    b_g: FloatArray,
    gravity_g: float,
    *,
    sd_g: FloatArray | None = None,
    cubic: bool = True,
) -> PairFit:
    """Least squares of (11) over all positions at once; with R of (12) where `sd_g` is given.

    Parameters
    ----------
    sd_g : array, shape (n, 2), or None
        Standard deviations of A and B. They are believed, unless the residuals exceed them
        significantly; without them the noise is that of the residuals.
    cubic : bool
        Whether K3 is fitted.

    Raises
    ------
    RefusedError
        When there are fewer than two more positions than coefficients, or they leave one open;
        as `refuse_other_readings`.
    """
    refuse_positions(source, theta_rad, gravity_g, cubic=cubic)
    refuse_other_readings(source, theta_rad, a_g, b_g, gravity_g)
    H, z = design(theta_rad, gravity_g, cubic=cubic), half_square(a_g, b_g, gravity_g)
    root = np.ones_like(z) if sd_g is None else half_square_sd(a_g, b_g, sd_g)
    white = H / root[:, None]
    values = np.linalg.lstsq(white, z / root, rcond=None)[0].astype(np.float64)
    residual = z - H @ values
    dof = len(z) - H.shape[1]
    found = float(np.sqrt(np.sum((residual / root) ** 2) / dof))
    noise = found if sd_g is None else believed(found, dof)
    covariance = (noise**2 * np.linalg.inv(white.T @ white)).astype(np.float64)
    sd: FloatArray = np.sqrt(np.diag(covariance))
    return PairFit(
        values=values,
        sd=sd,
        covariance=covariance,
        residual_g2=residual,
        condition=condition_number(H),
        doubtful=doubtful_position(residual / root, white, root),
        noise_ratio=None if sd_g is None else found,
    )


def refuse_positions(
    source: str, theta_rad: FloatArray, gravity_g: float, *, cubic: bool = True
) -> None:
    """Refuse too few positions, or positions that do not determine a coefficient."""
    H = design(theta_rad, gravity_g, cubic=cubic)
    unknowns = H.shape[1]
    if len(theta_rad) < unknowns + 2:
        raise RefusedError(
            source,
            f"{len(theta_rad)} positions",
            expected=f"at least {unknowns + 2} for {unknowns} coefficients; the paper has 28",
            remedy="measure more, as 28 positions from 5 deg in steps of 13 deg",
        )
    condition = condition_number(H)
    if condition > CONDITION_MAX:
        turned = ", are they in degrees?" if np.abs(theta_rad).max() > 7.0 else ""
        raise RefusedError(
            source,
            f"the angles, {np.degrees(theta_rad.min()):.4g} to {np.degrees(theta_rad.max()):.4g} "
            f"deg{turned}, do not determine all coefficients (condition number {condition:.3g})",
            expected=f"at most {CONDITION_MAX:g}; 28 positions from 5 deg by 13 deg have 3.1",
            remedy="spread the positions over the full turn",
        )


def terms_of_pair(kip_a: float, kip_b: float, axes: tuple[int, int]) -> Terms:
    """The coefficients in the quadratic model a = l + Q p(l): `axes` are those of A and B.

    On the head A's pendulum axis points along B's input axis and B's against A's, so A reads
    KipA a b more and B reads KipB a b less; both are taken off, to first order.
    """
    product = "".join(sorted("xyz"[k] for k in axes))
    Q = np.zeros((3, 6))
    Q[axes[0], PRODUCT_NAMES.index(product)] = -kip_a
    Q[axes[1], PRODUCT_NAMES.index(product)] = kip_b
    return Terms(quadratic_per_g=Q)


def stated_pair(unit: UnitDescription, folder: Path) -> PairTerms | None:
    """Cross-coupling of the pair that unit.toml names, if it names one.

    Raises
    ------
    RefusedError
        When the pair's file cannot be read, or leaves a coefficient open.
    """
    if unit.pair is None:
        return None
    path = folder / unit.pair.cross_coupling
    read = read_pair(path)
    fit = fit_pair(str(path), read.theta_rad, read.a_g, read.b_g, unit.gravity_g, sd_g=read.sd_g)
    return pair_terms(unit.pair.cross_coupling, fit, unit.pair.axes)


def pair_terms(file: str, fit: PairFit, axes: tuple[int, int]) -> PairTerms:
    """The coefficients of a fit as quadratic terms, with findings about them."""
    kip_a, kip_b = (float(v) for v in fit.values[4:6])
    Q = terms_of_pair(kip_a, kip_b, axes).quadratic_per_g
    assert Q is not None
    # Q is linear in the two coefficients.
    slopes = [terms_of_pair(*one, axes).quadratic_per_g for one in ((1, 0), (0, 1))]
    J = np.stack([np.zeros(18) if s is None else s.ravel() for s in slopes], axis=1)
    first, second = ("xyz"[k] for k in axes)
    subtracted = (
        f"cross-coupling of {file} is subtracted: KipA {kip_a:.3g} (sd {fit.sd[4]:.1g}), "
        f"KipB {kip_b:.3g} (sd {fit.sd[5]:.1g}) g/g^2, A along {first} and B along {second}"
    )
    covariance = (J @ fit.covariance[4:6, 4:6] @ J.T).astype(np.float64)
    findings = (subtracted, *_insignificant(file, fit))
    return PairTerms(Q, covariance, len(fit.residual_g2) - len(fit.values), findings)


def _insignificant(file: str, fit: PairFit) -> list[str]:
    """Findings about coefficients that are not significantly different from zero."""
    found = [NAMES[k] for k in (4, 5) if abs(fit.values[k]) < SIGNIFICANT_SD * fit.sd[k]]
    if len(found) == 2:
        advice = "leave [quadratic] cross_coupling out, or measure the pair longer"
        return [f"cross-coupling of {file} is not significant (both below 2 sd): {advice}"]
    return [f"{name} of {file} is not significant (below 2 sd)" for name in found]
