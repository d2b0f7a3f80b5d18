"""What an orthogonal pair of accelerometers on a dividing head reads, P3.

With phi = theta + dtheta + delta0 the pair reads, (1), (3) and (5) rebuilt,

    A = K0A + (1 + K1A) a + K3A a^3 + KipA a b          a = -g cos phi
    B = K0B + (1 + K1B) b + K3B b^3 - KipB b a          b = g sin(phi + b0)

(in B the pendulum axis points against A's input axis) and Z = (A^2 + B^2 - g^2) / 2 is, to first
order in the coefficients, with s, c of nominal theta,

    Z = K0B g s - K0A g c + K1A g^2 c^2 + K1B g^2 s^2
        + KipA g^3 s c^2 + KipB g^3 c s^2 + b0 g^2 s c - K3 g^4 s^2 c^2.

The squares cancel the table's error: it enters through products with the coefficients only.

c^4 = c^2 - s^2 c^2 and s^4 = s^2 - s^2 c^2. So of the two cubes Z shows K3 = K3A + K3B alone, and
K1 is the relative error of the sensitivity at 1 g, K1 + K3 g^2. The squares K2 of (1) give c^3 and
s^3, which are c - s^2 c and s - c^2 s: K2 of A is added to K0A and KipB, K2 of B to K0B and KipA.
Z cannot show them; a centrifuge does.

With the pair turned about the input axes, so that the output axes lie where the pendulum axes were,
Kio of (1) takes the place of Kip, and nothing else changes.
"""

from __future__ import annotations

import numpy as np

from triaxcal.model.types import FloatArray

NAMES = ("K0B", "K0A", "K1A", "K1B", "KipA", "KipB", "b0", "K3")
UNITS = ("g", "g", "", "", "g/g^2", "g/g^2", "rad", "g/g^3")
KIP = slice(4, 6)
"""Where the two cross-couplings stand."""
PENDULUM, OUTPUT = "pendulum", "output"
"""Which axes lie in the plane of rotation beside the input axes: Kip, or Kio, is measured."""


def names_of(mounting: str) -> tuple[str, ...]:
    """Names of the coefficients with a mounting."""
    return NAMES if mounting == PENDULUM else tuple(n.replace("Kip", "Kio") for n in NAMES)


def design(theta_rad: FloatArray, gravity_g: float, *, cubic: bool = True) -> FloatArray:
    """H of (10), shape (n, 8), columns in the order of `NAMES`; (n, 7), as printed, without K3."""
    g, s, c = gravity_g, np.sin(theta_rad), np.cos(theta_rad)
    columns = (g * s, -g * c, g**2 * c**2, g**2 * s**2, g**3 * s * c**2, g**3 * c * s**2)
    every = (*columns, g**2 * s * c, -(g**4) * s**2 * c**2)
    return np.stack(every if cubic else every[:-1], axis=-1)


def half_square(a_g: FloatArray, b_g: FloatArray, gravity_g: float) -> FloatArray:
    """Z of (8), shape (n,), in g^2, of readings in g."""
    result: FloatArray = (a_g**2 + b_g**2 - gravity_g**2) / 2.0
    return result


def half_square_sd(a_g: FloatArray, b_g: FloatArray, sd_g: FloatArray) -> FloatArray:
    """Root of R of (12), shape (n,): standard deviation of Z by those of A and B, (n, 2)."""
    result: FloatArray = np.hypot(a_g * sd_g[:, 0], b_g * sd_g[:, 1])
    return result


def condition_number(H: FloatArray) -> float:
    """Of a design with columns scaled to length 1."""
    length = np.linalg.norm(H, axis=0)
    singular = np.linalg.svd(H / np.where(length > 0.0, length, 1.0), compute_uv=False)
    return float(singular[0] / singular[-1]) if singular[-1] > 0.0 else float("inf")
