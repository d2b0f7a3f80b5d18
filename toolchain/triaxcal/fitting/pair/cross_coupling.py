"""Cross-coupling coefficients from an orthogonal pair of accelerometers on a dividing head, P3.

With phi = theta + dtheta + delta0 the pair reads, (3) and (5) rebuilt,

    A = K0A - (1 + K1A) g cos phi - g^2 KipA sin phi cos phi
    B = K0B + (1 + K1B) g sin(phi + b0) + g^2 KipB sin(phi + b0) cos(phi + b0)

and Z = (A^2 + B^2 - g^2) / 2 is, to first order in the coefficients, with s, c of nominal theta,

    Z = K0B g s - K0A g c + K1A g^2 c^2 + K1B g^2 s^2
        + KipA g^3 s c^2 + KipB g^3 c s^2 + b0 g^2 s c.

The squares cancel the table's error: it enters through products with the coefficients only.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.recorded import PairTerms
from triaxcal.fitting.pair.checks import doubtful_position, refuse_other_readings
from triaxcal.model.terms import PRODUCT_NAMES, Terms
from triaxcal.model.types import FloatArray
from triaxcal.readings.pair import read_pair
from triaxcal.unit.description import UnitDescription

NAMES = ("K0B", "K0A", "K1A", "K1B", "KipA", "KipB", "b0")
UNITS = ("g", "g", "", "", "g/g^2", "g/g^2", "rad")
CONDITION_MAX = 100.0
SIGNIFICANT_SD = 2.0


@dataclass(frozen=True)
class PairFit:
    """Seven coefficients in the order of `NAMES`.

    Attributes
    ----------
    values, sd : arrays, shape (7,)
    covariance : array, shape (7, 7)
    residual_g2 : array, shape (n,)
        Of Z.
    condition : float
        Of H, its columns scaled to length 1.
    doubtful : str
        The position that the others contradict, "" if there is none.
    """

    values: FloatArray
    sd: FloatArray
    covariance: FloatArray
    residual_g2: FloatArray
    condition: float
    doubtful: str


def design(theta_rad: FloatArray, gravity_g: float) -> FloatArray:
    """H of (10), shape (n, 7), columns in the order of `NAMES`."""
    g, s, c = gravity_g, np.sin(theta_rad), np.cos(theta_rad)
    columns = (g * s, -g * c, g**2 * c**2, g**2 * s**2, g**3 * s * c**2, g**3 * c * s**2)
    return np.stack([*columns, g**2 * s * c], axis=-1)


def half_square(a_g: FloatArray, b_g: FloatArray, gravity_g: float) -> FloatArray:
    """Z of (8), shape (n,), in g^2, of readings in g."""
    result: FloatArray = (a_g**2 + b_g**2 - gravity_g**2) / 2.0
    return result


def fit_pair(
    source: str, theta_rad: FloatArray, a_g: FloatArray, b_g: FloatArray, gravity_g: float
) -> PairFit:
    """Least squares of (11) over all positions at once.

    Raises
    ------
    RefusedError
        When there are fewer than nine positions, or they leave a coefficient open; as
        `refuse_other_readings`.
    """
    refuse_positions(source, theta_rad, gravity_g)
    refuse_other_readings(source, theta_rad, a_g, b_g, gravity_g)
    H, z = design(theta_rad, gravity_g), half_square(a_g, b_g, gravity_g)
    values = np.linalg.lstsq(H, z, rcond=None)[0].astype(np.float64)
    residual = z - H @ values
    variance = float(residual @ residual) / (len(z) - len(NAMES))
    covariance = (variance * np.linalg.inv(H.T @ H)).astype(np.float64)
    sd: FloatArray = np.sqrt(np.diag(covariance))
    doubtful = doubtful_position(residual, H)
    return PairFit(values, sd, covariance, residual, condition_number(H), doubtful)


@dataclass(frozen=True)
class Recursion:
    """Estimates after each position, from the seventh on: (12) in square-root information form.

    Attributes
    ----------
    values, sd : arrays, shape (n - 6, 7)
        `sd` for the noise that all residuals together show.
    """

    values: FloatArray
    sd: FloatArray


def recursive_pair(
    theta_rad: FloatArray, a_g: FloatArray, b_g: FloatArray, gravity_g: float
) -> Recursion:
    """Take one position after the other: nothing but a triangle of eight is kept between them.

    The Markov estimate of (12) with equal weights. Its covariance form needs a start that a guess
    would bias; the triangle R of R X = d needs none, and gives the batch solution to rounding.
    """
    H, z = design(theta_rad, gravity_g), half_square(a_g, b_g, gravity_g)
    triangle = np.zeros((len(NAMES) + 1, len(NAMES) + 1))
    values, inverses = [], []
    for k in range(len(z)):
        row = np.append(H[k], z[k])[None]
        triangle = np.asarray(np.linalg.qr(np.concatenate([triangle, row]), mode="r"))
        if k + 1 >= len(NAMES):
            R, d = triangle[: len(NAMES), : len(NAMES)], triangle[: len(NAMES), -1]
            values.append(np.linalg.solve(R, d))
            inverses.append(np.linalg.inv(R))
    dof = max(len(z) - len(NAMES), 1)
    noise = abs(float(triangle[-1, -1])) / np.sqrt(dof)
    sd = noise * np.array([np.linalg.norm(inverse, axis=1) for inverse in inverses])
    return Recursion(np.array(values), sd)


def converged_at(recursion: Recursion, factor: float = 2.0) -> int:
    """Position, from 1, from which on the sd of both Kip stays within `factor` of the last."""
    sd = recursion.sd[:, 4:6].max(axis=1)
    beyond = np.flatnonzero(sd > factor * sd[-1])
    return len(NAMES) + (int(beyond[-1]) + 1 if len(beyond) else 0)


def condition_number(H: FloatArray) -> float:
    """Of a design with columns scaled to length 1."""
    length = np.linalg.norm(H, axis=0)
    singular = np.linalg.svd(H / np.where(length > 0.0, length, 1.0), compute_uv=False)
    return float(singular[0] / singular[-1]) if singular[-1] > 0.0 else float("inf")


def refuse_positions(source: str, theta_rad: FloatArray, gravity_g: float) -> None:
    """Refuse too few positions, or positions that do not determine a coefficient."""
    if len(theta_rad) < len(NAMES) + 2:
        raise RefusedError(
            source,
            f"{len(theta_rad)} positions",
            expected=f"at least {len(NAMES) + 2} for {len(NAMES)} coefficients; the paper has 28",
            remedy="measure more, as 28 positions from 5 deg in steps of 13 deg",
        )
    condition = condition_number(design(theta_rad, gravity_g))
    if condition > CONDITION_MAX:
        turned = ", are they in degrees?" if np.abs(theta_rad).max() > 7.0 else ""
        raise RefusedError(
            source,
            f"the angles, {np.degrees(theta_rad.min()):.4g} to {np.degrees(theta_rad.max()):.4g} "
            f"deg{turned}, do not determine all coefficients (condition number {condition:.3g})",
            expected=f"at most {CONDITION_MAX:g}; 28 positions from 5 deg by 13 deg have 2.4",
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
    fit = fit_pair(str(path), *read_pair(path), unit.gravity_g)
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
    return PairTerms(Q, covariance, len(fit.residual_g2) - len(NAMES), findings)


def _insignificant(file: str, fit: PairFit) -> list[str]:
    """Findings about coefficients that are not significantly different from zero."""
    found = [NAMES[k] for k in (4, 5) if abs(fit.values[k]) < SIGNIFICANT_SD * fit.sd[k]]
    if len(found) == 2:
        advice = "leave [quadratic] cross_coupling out, or measure the pair longer"
        return [f"cross-coupling of {file} is not significant (both below 2 sd): {advice}"]
    return [f"{name} of {file} is not significant (below 2 sd)" for name in found]
