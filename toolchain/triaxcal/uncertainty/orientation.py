"""Orientations of 1 g, and what of the force is asked for in each."""

from __future__ import annotations

import itertools

import numpy as np

from triaxcal.model.positions import AXES
from triaxcal.model.terms import products
from triaxcal.model.types import FloatArray

QUANTITIES = ("a_x", "a_y", "a_z", "|a|")
_SPIRAL = 120


def weights(directions: FloatArray, columns: int = 4) -> FloatArray:
    """Rows w, shape (directions, 4, 3 columns), that give `QUANTITIES`' errors at 1 g from D.

    Error of a component: D_i [n; 1], with the products p(n) where D has ten `columns`; of the
    length: its projection on n.
    """
    count = len(directions)
    affine = affine_of(directions, columns)
    W = np.zeros((count, 4, 3, columns))
    for i in range(3):
        W[:, i, i] = affine
    W[:, 3] = directions[:, :, None] * affine[:, None, :]
    return W.reshape(count, 4, 3 * columns)


def affine_of(directions: FloatArray, columns: int) -> FloatArray:
    """Rows [n, 1, products of n], shape (directions, columns): D times such a row is an error."""
    parts = [directions, np.ones(len(directions)), products(directions)]
    return np.column_stack(parts)[:, :columns]


def force_variance(covariance: FloatArray, directions: FloatArray) -> FloatArray:
    """Variances of `QUANTITIES`, shape (..., directions, 4), of covariances of D (..., 12, 12).

    Or (..., 30, 30), with quadratic terms.

    The quadratic forms of `weights` as products of matrices; those of a component use its own
    block alone.
    """
    if covariance.shape[-1] != 12:
        W = weights(directions, covariance.shape[-1] // 3)
        variance: FloatArray = np.sum((W @ covariance[..., None, :, :]) * W, axis=-1)
        return variance
    lead = covariance.shape[:-2]
    affine = np.column_stack([directions, np.ones(len(directions))])
    pairs = (affine[:, :, None] * affine[:, None, :]).reshape(-1, 16).T
    blocks = covariance.reshape(*lead, 3, 4, 3, 4)
    result = np.empty((*lead, len(directions), 4))
    for i in range(3):
        own = blocks[..., i, :, i, :].reshape(-1, 16)
        result[..., i] = (own @ pairs).reshape(*lead, -1)
    w = weights(directions)[:, 3]
    upper = np.triu_indices(12)
    # Off the diagonal each pair of entries counts twice.
    twice = np.where(upper[0] == upper[1], 1.0, 2.0)
    squares = (w[:, upper[0]] * w[:, upper[1]] * twice).T
    result[..., 3] = (covariance[..., upper[0], upper[1]].reshape(-1, 78) @ squares).reshape(
        *lead, -1
    )
    return result


def _directions() -> FloatArray:
    """Unit vectors: axes, edges and corners of the cube, and a Fibonacci spiral between them."""
    lattice = [v for v in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(v)]
    k = np.arange(_SPIRAL) + 0.5
    z = 1.0 - 2.0 * k / _SPIRAL
    angle = np.pi * (1.0 + np.sqrt(5.0)) * k
    ring = np.sqrt(1.0 - z**2)
    spiral = np.column_stack([ring * np.cos(angle), ring * np.sin(angle), z])
    cube = np.array(lattice)
    result: FloatArray = np.vstack([cube / np.linalg.norm(cube, axis=1, keepdims=True), spiral])
    return result


DIRECTIONS = _directions()
"""Orientations over which the worst is sought, shape (directions, 3), axis order x, y, z."""


def in_words(direction: FloatArray) -> str:
    """Direction of the force as the axes that point up, or as a vector."""
    largest = float(np.max(np.abs(direction)))
    whole = direction / largest
    if np.allclose(whole, np.rint(whole), atol=1e-9):
        parts = [f"{'+' if v > 0 else '-'}{a}" for a, v in zip(AXES, whole, strict=True) if v]
        return f"{parts[0]} up" if len(parts) == 1 else f"{' and '.join(parts)} equally up"
    # Adding zero turns a rounded -0.0 into 0.0.
    return "force along (" + ", ".join(f"{v:+.2f}" for v in np.round(direction, 2) + 0.0) + ")"
