"""The metrological model a = K^-1 (U - U0), P1 (1), and its twelve passport constants."""

from __future__ import annotations

import numpy as np

from triaxcal.model.types import FloatArray

CONSTANT_NAMES: tuple[str, ...] = (
    "Kxx", "Kxy", "Kxz",
    "Kyx", "Kyy", "Kyz",
    "Kzx", "Kzy", "Kzz",
    "U0x", "U0y", "U0z",
)  # fmt: skip
"""Order of the twelve constants in every array with a last axis of 12: K row by row, then U0.

K_ij is the output of axis i (V) for 1 g along axis j; U0_i the bias of axis i (V).
"""

BIASES = (9, 10, 11)


def pack_constants(K_v_per_g: FloatArray, U0_v: FloatArray) -> FloatArray:
    """Twelve constants, shape (..., 12), of K (..., 3, 3) in V/g and U0 (..., 3) in V."""
    return np.concatenate([K_v_per_g.reshape(*K_v_per_g.shape[:-2], 9), U0_v], axis=-1)


def unpack_constants(constants: FloatArray) -> tuple[FloatArray, FloatArray]:
    """K (..., 3, 3) in V/g and U0 (..., 3) in V of constants of shape (..., 12)."""
    K = constants[..., :9].reshape(*constants.shape[:-1], 3, 3)
    return K, constants[..., 9:]


def sensitivities(constants: FloatArray) -> FloatArray:
    """Lengths of the rows of K, shape (..., 3): of each output along its own axis, however turned.

    Parameters
    ----------
    constants : array, shape (..., 12)
    """
    return np.asarray(np.linalg.norm(unpack_constants(constants)[0], axis=-1))


def voltage_from_force(constants: FloatArray, force_g: FloatArray) -> FloatArray:
    """U = K a + U0 in V, P1 (9); constants (..., 12), force (..., 3) in g."""
    K, U0 = unpack_constants(constants)
    voltage: FloatArray = np.einsum("...ij,...j->...i", K, force_g) + U0
    return voltage


def force_from_voltage(constants: FloatArray, voltage_v: FloatArray) -> FloatArray:
    """Solve P1 (1), a = K^-1 (U - U0) in g; constants (..., 12), voltage (..., 3) in V.

    Raises
    ------
    numpy.linalg.LinAlgError
        When K is singular.
    """
    K, U0 = unpack_constants(constants)
    solution = np.linalg.solve(K, (voltage_v - U0)[..., None])[..., 0]
    return solution.astype(np.float64)


def pack_blocks(blocks: FloatArray) -> FloatArray:
    """(..., 3, 4, 4), one block an output, as (..., 12, 12) in the order of `CONSTANT_NAMES`."""
    full = np.zeros((*blocks.shape[:-3], 12, 12))
    for i in range(3):
        index = np.array([3 * i, 3 * i + 1, 3 * i + 2, 9 + i])
        full[..., index[:, None], index] = blocks[..., i, :, :]
    return full


def exact_gain_and_offset(constants: FloatArray) -> tuple[FloatArray, FloatArray]:
    """N = K^-1 (..., 3, 3) in g/V and b = -N U0 (..., 3) in g of constants (..., 12)."""
    K, U0 = unpack_constants(constants)
    N = np.linalg.inv(K).astype(np.float64)
    return N, -np.einsum("...ij,...j->...i", N, U0)


def worst_force_error_g(
    found: tuple[FloatArray, FloatArray],
    exact: tuple[FloatArray, FloatArray],
    voltage_max_v: float,
) -> FloatArray:
    """Largest |error| per axis over all |U_j| <= voltage_max_v, shape (..., 3), in g.

    N U + b is linear in U, so the worst case lies in a corner of the box.
    """
    gain_error = np.abs(found[0] - exact[0]).sum(axis=-1)
    worst: FloatArray = gain_error * voltage_max_v + np.abs(found[1] - exact[1])
    return worst


def per(unit: str, by: str) -> str:
    """A unit by another: m/s^2 by g is (m/s^2)/g."""
    return "/".join(f"({name})" if "/" in name else name for name in (unit, by))
