"""What may be added to the linear calibration of a triad: quadratic terms and a term in dT/dt.

    l = N(T) U + b(T) + r dT/dt          dT/dt clamped to the range in which r was fitted
    a = l + Q p(l)                       p = (xx, yy, zz, xy, xz, yz) of l

Q is the quadratic calibration of P0 (13) written in products of the linear result instead of the
readings, so that it is independent of the raw scale and one matrix serves every temperature.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray

PRODUCT_NAMES: tuple[str, ...] = ("xx", "yy", "zz", "xy", "xz", "yz")
"""Order of the six products of a vector's components in every array of them."""

PRODUCT_AXES: tuple[tuple[int, int], ...] = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""The two axes of each product, in the order of `PRODUCT_NAMES`."""


def products(vector: FloatArray) -> FloatArray:
    """Products (..., 6) of the components of vectors (..., 3), in the order of `PRODUCT_NAMES`."""
    first, second = (list(axes) for axes in zip(*PRODUCT_AXES, strict=True))
    result: FloatArray = vector[..., first] * vector[..., second]
    return result


def product_slopes(vector: FloatArray) -> FloatArray:
    """Derivatives (..., 6, 3) of the products of vectors (..., 3) by their components."""
    result = np.zeros((*vector.shape[:-1], 6, 3))
    for k, (i, j) in enumerate(PRODUCT_AXES):
        result[..., k, i] += vector[..., j]
        result[..., k, j] += vector[..., i]
    return result


@dataclass(frozen=True)
class RateTerm:
    """Offset that a changing temperature adds.

    Attributes
    ----------
    offset_g_s_per_k : array, shape (3,)
        r: added to the offset, in g for 1 K/s, axes x, y, z.
    range_k_per_s : tuple of two floats
        Rates dT/dt in which r was fitted, from at most 0 to at least 0; one outside is clamped.
    """

    offset_g_s_per_k: FloatArray
    range_k_per_s: tuple[float, float]

    def __post_init__(self) -> None:
        low, high = self.range_k_per_s
        if self.offset_g_s_per_k.shape != (3,) or not low <= 0.0 <= high or low == high:
            raise ValueError("a rate term has three offsets and a range about zero")

    def offset_g(self, rate_k_per_s: FloatArray | float) -> FloatArray:
        """Offsets (..., 3) in g at rates of shape (...)."""
        rate = np.clip(rate_k_per_s, *self.range_k_per_s)
        result: FloatArray = np.asarray(rate)[..., None] * self.offset_g_s_per_k
        return result


@dataclass(frozen=True)
class Terms:
    """The terms beyond the linear calibration; what is None costs nothing on the device.

    Attributes
    ----------
    quadratic_per_g : array, shape (3, 6), or None
        Q in g/g^2: output axes x, y, z by the products of `PRODUCT_NAMES`.
    rate : RateTerm or None
        The term in dT/dt.
    """

    quadratic_per_g: FloatArray | None = None
    rate: RateTerm | None = None

    def __post_init__(self) -> None:
        if self.quadratic_per_g is not None and self.quadratic_per_g.shape != (3, 6):
            raise ValueError("quadratic terms are three rows of six")

    def force_g(self, linear_g: FloatArray, rate_k_per_s: FloatArray | float = 0.0) -> FloatArray:
        """Specific force (..., 3) in g of linear results N U + b, shape (..., 3), in g."""
        linear = linear_g if self.rate is None else linear_g + self.rate.offset_g(rate_k_per_s)
        if self.quadratic_per_g is None:
            return linear
        result: FloatArray = linear + products(linear) @ self.quadratic_per_g.T
        return result

    @property
    def quadratic(self) -> dict[str, float]:
        """Q by name, g/g^2, without what is zero: "Qx.xx" adds l_x^2 to a_x."""
        Q = np.zeros((3, 6)) if self.quadratic_per_g is None else self.quadratic_per_g
        return {
            f"Q{axis}.{name}": float(Q[i, k])
            for i, axis in enumerate(AXES)
            for k, name in enumerate(PRODUCT_NAMES)
            if Q[i, k]
        }

    @property
    def words(self) -> str:
        """What there is besides the linear constants; "" where nothing is."""
        own = {f"Q{axis}.{axis}{axis}" for axis in AXES}
        quadratic = "own-axis squares" if self.quadratic.keys() <= own else "quadratic terms"
        found = [quadratic] * bool(self.quadratic)
        return " and ".join(found + ["a term in dT/dt"] * (self.rate is not None))

    def lines(self) -> list[str]:
        """The equation and Q, three entries a line; nothing without quadratic terms."""
        each = [f"{name} {value * 1e3:+.5f}" for name, value in self.quadratic.items()]
        rows = ["  " + "  ".join(each[k : k + 3]) for k in range(0, len(each), 3)]
        rate = "" if self.rate is None else " + r dT/dt"
        equation = f"a = l + Q p(l), l = K^-1 (U - U0){rate}, p(l) products of l (xx: l_x^2)"
        return [f"{equation}; Q in mg/g^2:", *rows] if rows else []


NO_TERMS = Terms()

EXAMPLE_TERMS = Terms(
    quadratic_per_g=np.array(
        [
            [9.1e-4, -2.3e-4, 1.2e-4, 3.0e-4, -1.7e-4, 0.4e-4],
            [-1.0e-4, 1.4e-3, 0.7e-4, 2.2e-4, 5.0e-5, -6.1e-4],
            [3.3e-4, 1.0e-5, -7.7e-4, -2.0e-4, 4.4e-4, 1.9e-4],
        ]
    )
)
"""Of the size that data sheets of capacitive sensors state: what the C with terms is tried on."""

EXAMPLE_RATE = RateTerm(np.array([0.021, -0.0075, 0.0003]), (-0.05, 0.08))
"""Some mg of hysteresis at some K/min, as recordings of MEMS sensors show."""
